# Flags that every target of the project shares, in one place.
include(CheckCXXCompilerFlag)

# dcloth_runtime(TARGET): code a game links. C++17, no exceptions, no RTTI.
# dcloth_offline(TARGET): converter, tools, tests. C++20, exceptions allowed.
function(dcloth_common target)
  target_compile_options(${target} PRIVATE
    $<$<CXX_COMPILER_ID:GNU,Clang,AppleClang>:-Wall;-Wextra;-Wshadow;-ffp-contract=off>
    $<$<CXX_COMPILER_ID:MSVC>:/W4;/fp:precise>)
  if(EMSCRIPTEN AND DCLOTH_WASM_SIMD)  # kernels/dispatch.cc refuses to compile without
    target_compile_options(${target} PRIVATE -msimd128)
    target_compile_definitions(${target} PRIVATE DCLOTH_WASM_SIMD)
  endif()
  if(DCLOTH_WARNINGS_AS_ERRORS)
    target_compile_options(${target} PRIVATE
      $<$<CXX_COMPILER_ID:GNU,Clang,AppleClang>:-Werror> $<$<CXX_COMPILER_ID:MSVC>:/WX>)
  endif()
  if(DCLOTH_SANITIZE)
    target_compile_options(${target} PRIVATE
      -fsanitize=${DCLOTH_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
    target_link_options(${target} PUBLIC -fsanitize=${DCLOTH_SANITIZE})
  endif()
  get_target_property(type ${target} TYPE)
  # Fuzzers count edges there; tests need none in their own code.
  if(DCLOTH_BUILD_FUZZERS AND type STREQUAL STATIC_LIBRARY)
    target_compile_options(${target} PRIVATE -fsanitize=fuzzer-no-link)
  endif()
  set(relocatable ON)
  if(EMSCRIPTEN)  # a module is linked as a whole
    set(relocatable OFF)
  endif()
  set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF C_STANDARD 99 C_EXTENSIONS OFF
    POSITION_INDEPENDENT_CODE ${relocatable} CXX_VISIBILITY_PRESET hidden C_VISIBILITY_PRESET hidden)
endfunction()

# Sources of the current folder that a release build optimises otherwise, for size.
function(dcloth_optimize level)
  if(CMAKE_BUILD_TYPE STREQUAL "Release" AND CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang")
    set_source_files_properties(${ARGN} PROPERTIES COMPILE_OPTIONS ${level})
  endif()
endfunction()

function(dcloth_runtime target)
  dcloth_common(${target})
  set_target_properties(${target} PROPERTIES CXX_STANDARD 17 CXX_STANDARD_REQUIRED ON)
  target_compile_options(${target} PRIVATE
    $<$<AND:$<COMPILE_LANGUAGE:CXX>,$<CXX_COMPILER_ID:GNU,Clang,AppleClang>>:-fno-exceptions;-fno-rtti>)
  # Compilers for 64-bit Arm on Linux call their library for atomics, and it asks for the processor before main.
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "^(aarch64|arm64)$")
    check_cxx_compiler_flag(-mno-outline-atomics DCLOTH_HAS_INLINE_ATOMICS)
    if(DCLOTH_HAS_INLINE_ATOMICS)
      target_compile_options(${target} PRIVATE -mno-outline-atomics)
    endif()
  endif()
  if(DCLOTH_COVERAGE)
    target_compile_options(${target} PRIVATE --coverage -fprofile-update=atomic -O0)
    target_link_options(${target} PUBLIC --coverage)
  endif()
endfunction()

function(dcloth_offline target)
  dcloth_common(${target})
  set_target_properties(${target} PROPERTIES CXX_STANDARD 20 CXX_STANDARD_REQUIRED ON)
endfunction()

# dcloth_precompile(GROUP TARGET HEADER...): TARGET finds the headers parsed already; the first target of a group, an
# executable, parses them, the others of the same folder, with the same flags, take its. No source may rely on them:
# cross builds and builds with a compiler cache go without.
function(dcloth_precompile group target)
  if(NOT DCLOTH_PRECOMPILED_HEADERS)
    return()
  endif()
  get_property(leader GLOBAL PROPERTY DCLOTH_PRECOMPILED_${group})
  if(leader)
    target_precompile_headers(${target} REUSE_FROM ${leader})
  else()
    set_property(GLOBAL PROPERTY DCLOTH_PRECOMPILED_${group} ${target})
    target_precompile_headers(${target} PRIVATE ${ARGN})
  endif()
endfunction()
