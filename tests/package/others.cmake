# A tool that uses dermis::shader_compiler, dermis::gltf, dermis::cpu, dermis::verify and, if it is built, dermis::runtime_compiler.
include(${CMAKE_CURRENT_LIST_DIR}/package_test.cmake)

build_consumer(others "-DRUNTIME_COMPILER=${runtimeCompiler}")
run(printed "Run others_consumer" "${BUILD}/others_consumer" "${prefix}/${dataFolder}/dermis/shaders")
say("${printed}")
# The symbols whose absence other tests check must be found in a program with a shader compiler.
list_compiler_symbols(compiler "${BUILD}/others_consumer")
if(NOT compiler)
  wrong("no symbol of a shader compiler is found")
endif()
