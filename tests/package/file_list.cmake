# Dermis without CMake: the source package's files of core and vulkan, compiled one by one with the include folders that
# docs/building.md names, and linked into a program.
include(${CMAKE_CURRENT_LIST_DIR}/package_test.cmake)

set(source "${testFolder}/source_package/dermis-${version}")
set(work "${testFolder}/${NAME}")
file(REMOVE_RECURSE "${work}")
file(MAKE_DIRECTORY "${work}")
file(STRINGS "${sourceFolder}/docs/building.md" row REGEX "^[|] a list of files [|]")
string(REGEX REPLACE ".*include folders" "" row "${row}")
string(REGEX MATCHALL "`[^`]+`" named "${row}")
set(folders)
foreach(folder IN LISTS named)
  string(REPLACE "`" "" folder "${folder}")
  list(APPEND folders -I "${source}/${folder}")
endforeach()
file(GLOB_RECURSE sources "${source}/engine/src/core/*.cpp" "${source}/engine/src/vulkan/*.cpp")
list(APPEND sources "${source}/shaders/embedded/dermis_kernels.cpp" "${scriptFolder}/consumers/vulkan/main.cpp")

# Writes a build file for Ninja, to use all cores.
set(objects)
set(rules)
set(number 0)
foreach(file IN LISTS sources)
  math(EXPR number "${number} + 1")
  list(APPEND objects ${number}.o)
  string(APPEND rules "build ${number}.o: compile ${file}\n")
endforeach()
list(JOIN objects " " objects)
list(JOIN folders " " folders)
file(WRITE "${work}/build.ninja" "rule compile
  command = ${compilerLauncher} ${ownCompiler} -std=c++20 -Wall -Wextra -Werror ${consumerFlags} ${folders} -c $in -o $out
rule link
  command = ${ownCompiler} ${consumerFlags} $in -o $out
${rules}build program: link ${objects}\n")
list(LENGTH sources count)
run(ignored "Compile ${count} files and link them" "${ninja}" -C "${work}" -j 2)
run(printed "Run the program" "${work}/program")
say("${printed}")
