# Functions for all consumers. Compiles with an engine's strict flags, also for the headers of
# Dermis.

# consumer_flags(TARGET)
function(consumer_flags target)
  target_compile_options(${target} PRIVATE -fno-exceptions -fno-rtti -Wall -Wextra -Wpedantic -Wshadow -Wconversion
    -Wsign-conversion -Wold-style-cast -Wundef -Werror)
  set_target_properties(${target} PROPERTIES NO_SYSTEM_FROM_IMPORTED ON)
endfunction()

# consumer_headers(TARGET LIBRARY HEADERS...): compiles each header in its own source file, which includes it twice. Names are
# relative to the include folder.
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
