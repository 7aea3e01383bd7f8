# 32-bit x86, by Debian's cross compiler. Dermis' own CMake files must select SSE2 instead of the x87 unit. Linked statically, so
# that this machine can run it without the C library of that architecture.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR i686)
set(CMAKE_CXX_COMPILER i686-linux-gnu-g++)
set(CMAKE_C_COMPILER i686-linux-gnu-gcc)
set(CMAKE_EXE_LINKER_FLAGS_INIT -static)
# This machine runs its programs itself. Without an "emulator" CMake would look for them in PATH.
set(CMAKE_CROSSCOMPILING_EMULATOR env)
