# What the consumers share: an engine's strict flags, for the headers of Dermis too.

# consumer_flags(TARGET)
function(consumer_flags target)
  target_compile_options(${target} PRIVATE -fno-exceptions -fno-rtti -Wall -Wextra -Wpedantic -Wshadow -Wconversion
    -Wsign-conversion -Wold-style-cast -Wundef -Werror)
  set_target_properties(${target} PROPERTIES NO_SYSTEM_FROM_IMPORTED ON)
endfunction()

# consumer_headers(TARGET LIBRARY HEADERS...): compiles each header in a source of its own, which includes it twice; names
# count from the include folder.
function(consumer_headers target library)
  set(sources)
  foreach(header IN LISTS ARGN)
    string(MAKE_C_IDENTIFIER "${header}" name)
    set(source ${CMAKE_CURRENT_BINARY_DIR}/${target}/${name}.cpp)
    file(WRITE ${source} "#include \"${header}\"\n#include \"${header}\"\n")
    list(APPEND sources ${source})
  endforeach()
  add_library(${target} OBJECT ${sources})
  target_link_libraries(${target} PRIVATE ${library})
  consumer_flags(${target})
endfunction()
