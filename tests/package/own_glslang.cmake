# A subproject of an engine with its own glslang, SPIRV-Tools, GLM and Vulkan-Headers, which define only some of the names of their
# packages: it must configure. With BUILDS, a program is also built and run; its kernels are compiled by a tool that is built
# separately, with the system's glslang.
include(${CMAKE_CURRENT_LIST_DIR}/package_test.cmake)

foreach(compiler IN ITEMS ON OFF)
  set(build "${testFolder}/${NAME}")
  file(REMOVE_RECURSE "${build}")
  run(configured "Configure with DERMIS_BUILD_SHADER_COMPILER=${compiler}" ${CMAKE_COMMAND} -S "${scriptFolder}/consumers/own_glslang" -B "${build}"
      -G "${generator}" "-DCMAKE_MAKE_PROGRAM=${makeProgram}" "-DCMAKE_CXX_COMPILER=${COMPILER}" "-DDERMIS_SOURCE=${sourceFolder}"
      --no-warn-unused-cli "-DGLM_FOLDERS=${glmFolders}" -DDERMIS_BUILD_SHADER_COMPILER=${compiler} -DCMAKE_DISABLE_FIND_PACKAGE_glm=TRUE
      -DCMAKE_DISABLE_FIND_PACKAGE_VulkanHeaders=TRUE -DCMAKE_DISABLE_FIND_PACKAGE_glslang=TRUE
      -DCMAKE_DISABLE_FIND_PACKAGE_SPIRV-Tools=TRUE "-DCMAKE_CXX_COMPILER_LAUNCHER=${compilerLauncher}")
  if(configured MATCHES "CMake (Deprecation )?Warning")
    wrong("CMake warns:\n${configured}")
  endif()
endforeach()

if(BUILDS)
  run(ignored "Build the engine" ${CMAKE_COMMAND} --build "${build}" --target engine --parallel 2)
  run(printed "Run it" "${build}/engine")
  say("${printed}")
endif()
