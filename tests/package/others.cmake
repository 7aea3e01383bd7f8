# A tool that uses dermis::shader_compiler, dermis::gltf, dermis::cpu, dermis::verify and, if it is built, dermis::runtime_compiler.
include(${CMAKE_CURRENT_LIST_DIR}/package_test.cmake)

build_consumer(others "-DRUNTIME_COMPILER=${runtimeCompiler}")
run(printed "Run others_consumer" "${BUILD}/others_consumer" "${prefix}/${dataFolder}/dermis/shaders")
say("${printed}")
# What the tests of programs without a shader compiler look for is found in one that has it.
list_compiler_symbols(compiler "${BUILD}/others_consumer")
if(NOT compiler)
  wrong("no symbol of a shader compiler is found")
endif()
