# A tool that uses dermis::shader_compiler, dermis::gltf, dermis::cpu and dermis::verify.
include(${CMAKE_CURRENT_LIST_DIR}/package_test.cmake)

build_consumer(others)
run(printed "Run others_consumer" "${BUILD}/others_consumer" "${prefix}/${dataFolder}/dermis/shaders")
say("${printed}")
