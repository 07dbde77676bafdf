import importlib
import pkgutil

import noisemodel


def test_the_names_of_the_package_are_the_public_ones():
    assert dir(noisemodel) == sorted(noisemodel.__all__)
    assert all(hasattr(noisemodel, name) for name in dir(noisemodel))


def test_submodules_can_be_imported():
    names = [module.name for module in pkgutil.iter_modules(noisemodel.__path__)]
    assert {"run", "compare", "files"} <= set(names)
    for name in names:
        importlib.import_module(f"noisemodel.{name}")


def test_the_name_of_a_function_is_that_function():
    for name in ("compare", "extended", "simplified"):
        assert callable(getattr(noisemodel, name))
