# 32-bit ARM with hardware floating point and NEON (Raspberry Pi 2 and later with a 32-bit system).
set(MAPLET_ARCH armhf)
set(MAPLET_TRIPLET arm-linux-gnueabihf)
set(MAPLET_QEMU qemu-arm)
set(CMAKE_SYSTEM_PROCESSOR armv7l)
# Debian's armhf leaves NEON out; Eigen and the kernels want it. The first NEON: no fused multiply-add.
set(CMAKE_C_FLAGS_INIT -mfpu=neon)
set(CMAKE_CXX_FLAGS_INIT "-mfpu=neon -Wno-psabi")  # no news of what GCC 7 changed
include(${CMAKE_CURRENT_LIST_DIR}/debian_sysroot.cmake)
