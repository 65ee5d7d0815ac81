# 64-bit Arm Linux from another machine: Debian's g++-aarch64-linux-gnu, tests under qemu-user.
# DCLOTH_QEMU_CPU: the processor that qemu plays. "max" has every extension qemu knows; cortex-a53 has none beyond
# ARMv8.0, so an instruction that the baseline lacks stops the test there.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
include(${CMAKE_CURRENT_LIST_DIR}/cross_search.cmake)

set(DCLOTH_QEMU_CPU max CACHE STRING "Processor that qemu-aarch64 plays (qemu-aarch64 -cpu help)")
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64 -L /usr/aarch64-linux-gnu -cpu ${DCLOTH_QEMU_CPU})
