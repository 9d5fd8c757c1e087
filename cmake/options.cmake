set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)

# A service of the system: its units name where the programs are.
if(CMAKE_INSTALL_PREFIX_INITIALIZED_TO_DEFAULT)
  set(CMAKE_INSTALL_PREFIX /usr CACHE PATH "Where cmake --install puts it" FORCE)
endif()

option(MAPLET_TESTS "Build the tests" ON)
option(MAPLET_BENCH "Build the benchmarks" OFF)
option(MAPLET_FUZZ "Make the fuzz targets fuzzers (clang)" OFF)
set(MAPLET_SANITIZE "" CACHE STRING "Sanitizers, as in -fsanitize=...")

find_program(CCACHE ccache)
if(CCACHE)
  set(CMAKE_C_COMPILER_LAUNCHER ${CCACHE})
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CCACHE})
endif()

# What runs once in a while: small, a third less than with -O1 and not slower to compile.
function(maplet_cold target)
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-Os>)
endfunction()

# maplet_precompile(target headers...): a third of a build from nothing. Where there is a ccache, it
# keeps the objects instead: the two do not go together. ARM's presets, mostly built once, leave it out.
function(maplet_precompile target)
  if(NOT CCACHE)
    target_precompile_headers(${target} PRIVATE ${ARGN})
  endif()
endfunction()

# 32-bit systems: recordings of more than 2 GiB, disks with 64-bit inodes.
if(CMAKE_SIZEOF_VOID_P EQUAL 4)
  add_compile_definitions(_FILE_OFFSET_BITS=64)
endif()
# 32-bit NEON has no division and no square root: Eigen's are estimates there, right to 16 bits (places
# were described with them). Scalars round as everywhere; the kernels that use NEON are our own.
if(CMAKE_SIZEOF_VOID_P EQUAL 4 AND CMAKE_SYSTEM_PROCESSOR MATCHES "^arm")
  add_compile_definitions(EIGEN_DONT_VECTORIZE)
endif()

# What every target of ours is compiled with.
add_library(maplet_options INTERFACE)
target_include_directories(maplet_options INTERFACE ${CMAKE_SOURCE_DIR})
target_compile_options(
  maplet_options
  INTERFACE -Wall -Wextra -Wshadow -Wconversion -Wno-sign-conversion -Werror=return-type
            $<$<COMPILE_LANGUAGE:CXX>:-Wnon-virtual-dtor>
            # No fused multiply-add unless written: the same bytes on every build of one machine.
            -ffp-contract=off)
# Eigen's alignment must not follow a file's instruction set: one layout in every object file.
target_compile_definitions(maplet_options INTERFACE EIGEN_MAX_ALIGN_BYTES=16 EIGEN_MPL2_ONLY
                                                    MAPLET_VERSION="${PROJECT_VERSION}")
# What is installed holds no function that nobody calls.
add_compile_options($<$<CONFIG:Release>:-ffunction-sections> $<$<CONFIG:Release>:-fdata-sections>)
add_link_options($<$<CONFIG:Release>:-Wl,--gc-sections>)
# And equal functions once: 4 % smaller. The linker that can is in every binutils of Debian 12.
include(CheckLinkerFlag)
check_linker_flag(CXX "-fuse-ld=gold;-Wl,--icf=safe" MAPLET_FOLDS)
if(MAPLET_FOLDS AND NOT CMAKE_CROSSCOMPILING)
  add_link_options($<$<CONFIG:Release>:-fuse-ld=gold> $<$<CONFIG:Release>:-Wl,--icf=safe>)
endif()
if(MAPLET_FUZZ)
  add_compile_options(-fsanitize=fuzzer-no-link)
endif()
if(MAPLET_SANITIZE)
  add_compile_options(-fsanitize=${MAPLET_SANITIZE} -fno-omit-frame-pointer
                      -fno-sanitize-recover=undefined)
  add_link_options(-fsanitize=${MAPLET_SANITIZE})
  target_compile_definitions(maplet_options INTERFACE MAPLET_SANITIZED=1)
endif()
