# Makes the source package: the files of Dermis that git tracks, except the tests, and the compiled kernels. Building from it needs
# neither glslang nor SPIRV-Tools. `cmake --build BUILD --target source_package` runs this script.
#
#   cmake -DSOURCE=folder -DKERNELS=folder -DVERSION=x.y.z -DOUTPUT=folder -P source_package.cmake
#
# KERNELS is the folder of dermis_kernels.h and dermis_kernels.cpp. Writes OUTPUT/dermis-VERSION.tar.gz.
cmake_minimum_required(VERSION 3.25)

find_program(git git REQUIRED)
# Includes untracked files that are not ignored, so that the package can be made before a commit.
execute_process(COMMAND ${git} -C ${SOURCE} ls-files --cached --others --exclude-standard -- CMakeLists.txt CHANGELOG.md LICENSE README.md
                        SECURITY.md cmake docs engine samples shaders
                OUTPUT_VARIABLE files OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
string(REPLACE "\n" ";" files "${files}")

set(name dermis-${VERSION})
set(staging ${OUTPUT}/source_package)
file(REMOVE_RECURSE ${staging})
foreach(file IN LISTS files)
  if(EXISTS ${SOURCE}/${file})  # git also lists a file whose removal is not committed
    get_filename_component(folder ${file} DIRECTORY)
    file(COPY ${SOURCE}/${file} DESTINATION ${staging}/${name}/${folder})
  endif()
endforeach()
file(COPY ${KERNELS}/dermis_kernels.h ${KERNELS}/dermis_kernels.cpp DESTINATION ${staging}/${name}/shaders/embedded)
execute_process(COMMAND ${CMAKE_COMMAND} -E tar czf ${OUTPUT}/${name}.tar.gz --format=gnutar ${name}
                WORKING_DIRECTORY ${staging} COMMAND_ERROR_IS_FATAL ANY)
file(REMOVE_RECURSE ${staging})
message(STATUS "Made ${OUTPUT}/${name}.tar.gz")
