# The C interface as it is installed: the functions that the shared libraries export and the bytes of its structures are those of
# c_interface.txt; the header is C99; a program in C++17 needs nothing else. With DERMIS_UPDATE_DOCUMENTS set, the list is written.
include(${CMAKE_CURRENT_LIST_DIR}/package_test.cmake)

set(found "# Functions that libdermis and libdermis_compare export, and bytes of their structures on 64-bit systems. A change is a change of the
# binary interface: raise the version in result.h, from which the soname is made, say it in CHANGELOG.md, and run the test package.c_interface
# with DERMIS_UPDATE_DOCUMENTS=1.
soname ${soversion}\n")
foreach(name IN ITEMS dermis dermis_compare)
  set(library "${prefix}/${libFolder}/lib${name}.so")
  run(symbols "List what ${library} exports" "${nm}" -D --defined-only "${library}")
  string(REGEX MATCHALL "[^\n]+" lines "${symbols}")
  set(functions)
  foreach(line IN LISTS lines)
    if(NOT line MATCHES " T (dermis_[a-z0-9_]+)$")
      wrong("${library} exports ${line}")
    endif()
    list(APPEND functions "${name} ${CMAKE_MATCH_1}\n")
  endforeach()
  list(SORT functions) # not by their addresses
  string(APPEND found ${functions})
endforeach()

set(program "#define DERMIS_VULKAN\n#include \"dermis/dermis.h\"\n#include <stdio.h>\nint main(void) {\n")
file(READ "${prefix}/${includeFolder}/dermis/dermis.h" text)
string(REGEX MATCHALL "typedef struct dermis_[a-z0-9_]+ {" structures "${text}")
list(LENGTH structures count)
if(count LESS 50)
  wrong("the header has only ${count} structures")
endif()
list(SORT structures)
foreach(structure IN LISTS structures)
  string(REGEX MATCH "dermis_[a-z0-9_]+" structure "${structure}")
  string(APPEND program "  printf(\"struct ${structure} %u\\n\", (unsigned)sizeof(${structure}));\n")
endforeach()
file(WRITE "${testFolder}/${NAME}.c" "${program}  return 0;\n}\n")
set(flags -Wall -Wextra -pedantic -Werror -I "${prefix}/${includeFolder}")
run(ignored "Compile the sizes as C99" "${ownCompiler}" -x c -std=c99 ${flags} "${testFolder}/${NAME}.c" -o "${testFolder}/${NAME}.sizes")
run(sizes "Print them" "${testFolder}/${NAME}.sizes")
string(APPEND found "${sizes}")
set(list "${CMAKE_CURRENT_LIST_DIR}/c_interface.txt")
if(DEFINED ENV{DERMIS_UPDATE_DOCUMENTS})
  file(WRITE "${list}" "${found}")
endif()
file(READ "${list}" expected)
if(NOT found STREQUAL expected)
  file(WRITE "${testFolder}/${NAME}.txt" "${found}")
  execute_process(COMMAND diff "${list}" "${testFolder}/${NAME}.txt" OUTPUT_VARIABLE difference)
  wrong("the binary interface is not that of c_interface.txt, which says what to do:\n${difference}")
endif()

# Vulkan's functions are there only if they are asked for, or Vulkan's header was included before.
foreach(first IN ITEMS "" "#include <vulkan/vulkan.h>\n" "#define DERMIS_VULKAN\n")
  file(WRITE "${testFolder}/${NAME}.c" "${first}#include \"dermis/dermis.h\"
int main(void) {
#ifndef VULKAN_CORE_H_
  const int dermis_record = 0;
#endif
  (void)dermis_record;
  return DERMIS_OK;
}\n")
  run(ignored "Compile '${first}'" "${ownCompiler}" -x c -std=c99 -fsyntax-only -Wall -Wextra -Werror -I "${prefix}/${includeFolder}"
      "${testFolder}/${NAME}.c")
endforeach()

file(READ "${prefix}/${dataFolder}/dermis/dermis.cdef.h" declarations)
if(declarations MATCHES "#|extern|Vk[A-Z]|//" OR NOT declarations MATCHES "dermis_compare[(]")
  wrong("dermis.cdef.h has '${CMAKE_MATCH_0}'")
endif()

set(ENV{PKG_CONFIG_PATH} "${prefix}/${libFolder}/pkgconfig")
run(linked "Ask pkg-config" "${pkgConfig}" --cflags --libs dermis-c-compare)
if(linked MATCHES "dermis_core")
  wrong("a program in C needs only the shared libraries: ${linked}")
endif()
separate_arguments(linked UNIX_COMMAND "${linked}")
separate_arguments(own UNIX_COMMAND "${consumerFlags}")
run(ignored "Compile a program in C++17" "${ownCompiler}" -std=c++17 -Wall -Wextra -Werror ${own} "${scriptFolder}/consumers/cpp17/main.cpp"
    -o "${testFolder}/${NAME}.cpp17" ${linked} "-Wl,-rpath,${prefix}/${libFolder}")
run(printed "Run it" "${testFolder}/${NAME}.cpp17")
if(NOT printed MATCHES "every one is right")
  wrong("${printed}")
endif()
