# dermis::core must compile without the headers of other layers' dependencies. The files in poison/ replace them by errors. With
# HEADERS: compiles each header alone, but those that are included inside a namespace.
include(${CMAKE_CURRENT_LIST_DIR}/package_test.cmake)

set(flags -std=c++20 -fsyntax-only -fno-exceptions -fno-rtti -Wall -Wextra -Werror -I "${scriptFolder}/poison"
    -I "${sourceFolder}/engine/include" -I "${sourceFolder}/engine/src" -I "${coreFolder}" -I "${sourceFolder}/shaders")
foreach(folder IN LISTS glmFolders)
  list(APPEND flags -idirafter "${folder}")
endforeach()

list(TRANSFORM coreSources PREPEND "${coreFolder}/")
file(GLOB headers "${sourceFolder}/engine/include/dermis/*.h")
file(GLOB_RECURSE privateHeaders "${sourceFolder}/engine/src/core/*.h")
if(HEADERS)
  list(FILTER privateHeaders EXCLUDE REGEX "_inl\\.h$")
  foreach(file IN LISTS headers privateHeaders)
    file(RELATIVE_PATH name "${sourceFolder}" "${file}")
    run(ignored "Compile ${name}" "${ownCompiler}" ${flags} -include "${file}" -x c++ /dev/null)
  endforeach()
  return()
endif()

# Only preprocesses, which finds #error; the build compiles the files.
list(REMOVE_ITEM flags -fsyntax-only)  # Clang warns of it
set(text)
foreach(file IN LISTS headers privateHeaders coreSources)
  string(APPEND text "#include \"${file}\"\n")
endforeach()
file(WRITE "${testFolder}/${NAME}.cpp" "${text}")
run(ignored "Preprocess headers and sources" "${ownCompiler}" ${flags} -M "${testFolder}/${NAME}.cpp")

say("The poison works: a header that needs Vulkan cannot be included")
execute_process(COMMAND "${ownCompiler}" ${flags} -M -include "${sourceFolder}/engine/include/dermis/vulkan/context.h"
                        -x c++ /dev/null
                RESULT_VARIABLE status OUTPUT_QUIET ERROR_VARIABLE printed)
if(status EQUAL 0 OR NOT printed MATCHES "dermis::core must not need")
  wrong("dermis/vulkan/context.h was included, or failed for another reason:\n${printed}")
endif()
