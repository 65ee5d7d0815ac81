# 64-bit Arm Android without the NDK, the library alone: Debian's clang, which knows the system's calling convention (it
# leaves register x18 alone, for instance), headers of Debian's compiler for Arm Linux, and its linker. The library
# calls a dozen functions of libc.so and libm.so, which are the same on both systems. scripts/package.sh brings
# libraries to link with that hold these names alone. The NDK's own file is android.cmake.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER clang)
set(CMAKE_CXX_COMPILER clang++)
set(CMAKE_C_COMPILER_TARGET aarch64-linux-android24)
set(CMAKE_CXX_COMPILER_TARGET aarch64-linux-android24)
set(CMAKE_PLATFORM_NO_VERSIONED_SONAME ON)  # as Android's packages need it
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)  # a program would need Android's C library
include(${CMAKE_CURRENT_LIST_DIR}/cross_search.cmake)

set(dcloth_headers /usr/aarch64-linux-gnu/include)
file(GLOB dcloth_cxx ${dcloth_headers}/c++/*)
if(NOT dcloth_cxx)
  message(FATAL_ERROR "platforms/cmake/android_clang.cmake: found no ${dcloth_headers}/c++; "
    "run scripts/install_dependencies.sh cross_android")
endif()
list(SORT dcloth_cxx COMPARE NATURAL ORDER DESCENDING)
list(GET dcloth_cxx 0 dcloth_cxx)
set(CMAKE_C_FLAGS_INIT "-isystem ${dcloth_headers}")
set(CMAKE_CXX_FLAGS_INIT
  "-nostdinc++ -isystem ${dcloth_cxx} -isystem ${dcloth_cxx}/aarch64-linux-gnu -isystem ${dcloth_headers}")
