# This system, with Clang and LLVM's C++ standard library.
find_program(clang NAMES clang++-16 clang++ REQUIRED NO_CACHE)
set(CMAKE_CXX_COMPILER ${clang})
string(REPLACE "clang++" "clang" CMAKE_C_COMPILER ${clang})
set(CMAKE_CXX_FLAGS_INIT -stdlib=libc++)
