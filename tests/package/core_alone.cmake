# dermis::core must compile without the headers of other layers' dependencies. The files in poison/ replace them by errors.
include(${CMAKE_CURRENT_LIST_DIR}/package_test.cmake)

set(flags -std=c++20 -fsyntax-only -fno-exceptions -fno-rtti -Wall -Wextra -Werror -I "${scriptFolder}/poison"
    -I "${sourceFolder}/engine/include" -I "${sourceFolder}/engine/src" -I "${coreFolder}" -I "${sourceFolder}/shaders")
foreach(folder IN LISTS glmFolders)
  list(APPEND flags -idirafter "${folder}")
endforeach()

list(TRANSFORM coreSources PREPEND "${coreFolder}/")
file(GLOB headers "${sourceFolder}/engine/include/dermis/*.h")
file(GLOB_RECURSE privateHeaders "${sourceFolder}/engine/src/core/*.h")
# Only preprocesses, which finds #error; the build compiles the headers.
set(preprocessing ${flags})
list(REMOVE_ITEM preprocessing -fsyntax-only)  # Clang warns of it
run(ignored "Preprocess the sources" "${ownCompiler}" ${preprocessing} -M ${coreSources})
foreach(file IN LISTS headers privateHeaders)
  file(RELATIVE_PATH name "${sourceFolder}" "${file}")
  run(ignored "Compile ${name}" "${ownCompiler}" ${flags} -include "${file}" -x c++ /dev/null)
endforeach()

say("The poison works: a header that needs Vulkan does not compile")
execute_process(COMMAND "${ownCompiler}" ${flags} -include "${sourceFolder}/engine/include/dermis/vulkan/context.h"
                        -x c++ /dev/null
                RESULT_VARIABLE status OUTPUT_QUIET ERROR_VARIABLE printed)
if(status EQUAL 0 OR NOT printed MATCHES "dermis::core must not need")
  wrong("dermis/vulkan/context.h compiled, or failed for another reason:\n${printed}")
endif()
