# 64-bit ARM (Raspberry Pi 3 and later with a 64-bit system, Jetson, most boards).
set(MAPLET_ARCH arm64)
set(MAPLET_TRIPLET aarch64-linux-gnu)
set(MAPLET_QEMU qemu-aarch64)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
include(${CMAKE_CURRENT_LIST_DIR}/debian_sysroot.cmake)
