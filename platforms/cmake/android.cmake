# Android by the NDK (environment variable ANDROID_NDK_HOME): its own toolchain file, with the settings of this project.
# DCLOTH_ANDROID_NDK overrides the variable; ANDROID_ABI is arm64-v8a unless set (x86_64 for the emulator).
set(DCLOTH_ANDROID_NDK "$ENV{ANDROID_NDK_HOME}" CACHE PATH "Android NDK, r23 or later")
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES DCLOTH_ANDROID_NDK)
set(dcloth_ndk_toolchain ${DCLOTH_ANDROID_NDK}/build/cmake/android.toolchain.cmake)
if(NOT EXISTS ${dcloth_ndk_toolchain})
  message(FATAL_ERROR "platforms/cmake/android.cmake: found no ${dcloth_ndk_toolchain}; "
    "set the environment variable ANDROID_NDK_HOME to an NDK, r23 or later")
endif()

if(NOT DEFINED ANDROID_ABI)
  set(ANDROID_ABI arm64-v8a)
endif()
if(NOT DEFINED ANDROID_PLATFORM)
  set(ANDROID_PLATFORM android-24)
endif()
# Pages of 16 KB, which Android 15 devices may have. engine/CMakeLists.txt tells the linker, whatever the NDK.
set(ANDROID_SUPPORT_FLEXIBLE_PAGE_SIZES ON)
include(${dcloth_ndk_toolchain})
