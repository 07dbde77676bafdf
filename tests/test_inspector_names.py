import inspector


def test_the_names_of_the_package_are_the_public_ones():
    assert dir(inspector) == sorted(inspector.__all__)


def test_each_public_name_can_be_imported():
    assert all(hasattr(inspector, name) for name in inspector.__all__)
