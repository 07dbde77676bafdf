#!/bin/sh
# Installs the software Vulkan driver that pictures of recordings need, if it is missing and that is possible.
# Without it the tests that take pictures skip, and say so.
ls /usr/share/vulkan/icd.d/lvp_icd*.json >/dev/null 2>&1 && exit 0
command -v apt-get >/dev/null 2>&1 || exit 0
[ "$(id -u)" = 0 ] || exit 0
packages="mesa-vulkan-drivers libvulkan1"
apt-get install -y --no-install-recommends $packages >/dev/null 2>&1 && exit 0
apt-get update >/dev/null 2>&1 && apt-get install -y --no-install-recommends $packages >/dev/null 2>&1
exit 0
