# Debian's cross compiler against a private sysroot (tools/sysroot), run by qemu-user.
# The including file sets: MAPLET_ARCH (Debian's name), MAPLET_TRIPLET, MAPLET_QEMU.
set(CMAKE_SYSTEM_NAME Linux)
set(MAPLET_SYSROOT ${CMAKE_CURRENT_LIST_DIR}/../build/sysroot/${MAPLET_ARCH})
if(NOT EXISTS ${MAPLET_SYSROOT}/usr/lib/${MAPLET_TRIPLET}/libc.so.6)
  message(FATAL_ERROR "no sysroot for ${MAPLET_ARCH}: tools/build-arm ${MAPLET_ARCH} makes it and builds, "
                      "tools/sysroot ${MAPLET_ARCH} alone makes it")
endif()
cmake_path(NORMAL_PATH MAPLET_SYSROOT)
set(CMAKE_C_COMPILER ${MAPLET_TRIPLET}-gcc)
set(CMAKE_CXX_COMPILER ${MAPLET_TRIPLET}-g++)
set(CMAKE_SYSROOT ${MAPLET_SYSROOT})
set(CMAKE_LIBRARY_ARCHITECTURE ${MAPLET_TRIPLET})

# Programs come from this machine (idlc among them), all else from the sysroot.
set(CMAKE_FIND_ROOT_PATH ${MAPLET_SYSROOT})
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(ENV{PKG_CONFIG_SYSROOT_DIR} ${MAPLET_SYSROOT})
set(ENV{PKG_CONFIG_LIBDIR} ${MAPLET_SYSROOT}/usr/lib/${MAPLET_TRIPLET}/pkgconfig:${MAPLET_SYSROOT}/usr/share/pkgconfig)

find_program(MAPLET_EMULATOR NAMES ${MAPLET_QEMU}-static ${MAPLET_QEMU})
if(MAPLET_EMULATOR)
  set(CMAKE_CROSSCOMPILING_EMULATOR ${MAPLET_EMULATOR} -L ${MAPLET_SYSROOT})
endif()
