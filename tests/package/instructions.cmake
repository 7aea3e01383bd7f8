# dermis::cpu chooses among instruction sets at run time, so code for AVX may only be in the namespaces of AVX targets. Anywhere
# else, for example in an inline function of the standard library, the linker could choose it for code that every processor runs.
include(${CMAKE_CURRENT_LIST_DIR}/package_test.cmake)

set(library "${prefix}/${libFolder}/libdermis_cpu.a")
say("Disassemble ${library}")
execute_process(COMMAND "${objdump}" -d -C --no-show-raw-insn "${library}"
                COMMAND awk "/^[0-9a-f]+ </ { name = $0; sub(/^[0-9a-f]+ /, \"\", name); avx = name ~ /N_AVX[23]/ }
                             /\tv[a-z0-9]+[ \t]/ { if (avx) ++inside; else if (!seen[name]++) print \"  \" name }
                             END { print inside + 0, \"instructions in AVX namespaces\" }"
                OUTPUT_VARIABLE found COMMAND_ERROR_IS_FATAL ANY)
string(REGEX MATCH "([0-9]+) instructions in AVX namespaces" count "${found}")
if(NOT CMAKE_MATCH_1 GREATER 1000)
  wrong("no code for AVX was found:\n${found}")
elseif(NOT found STREQUAL "${count}\n")
  wrong("code for AVX outside of their namespaces:\n${found}")
endif()
