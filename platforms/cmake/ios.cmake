# iOS from a Mac with Xcode: a static library, as the App Store's tools expect it.
# CMAKE_OSX_SYSROOT is iphoneos unless set (iphonesimulator for the simulator).
set(CMAKE_SYSTEM_NAME iOS)
if(NOT DEFINED CMAKE_OSX_SYSROOT)
  set(CMAKE_OSX_SYSROOT iphoneos)
endif()
set(CMAKE_OSX_ARCHITECTURES arm64 CACHE STRING "Processors")
set(CMAKE_OSX_DEPLOYMENT_TARGET 13.0 CACHE STRING "First iOS version with std::filesystem, for platforms/mapped_file")
# The engine's headers and flatc come from the Mac, which CMake leaves out for iOS unless told.
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE BOTH)
