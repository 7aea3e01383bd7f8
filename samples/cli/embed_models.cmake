# Writes built_in_models.cpp, the bytes of the sample models that the command contains:
#
#   cmake -DMODELS=samples/models -DOUTPUT=built_in_models.cpp -P embed_models.cmake
set(text "#include \"comparison_picture.h\"\n\nnamespace dermis::cli {\n")
foreach(name IN ITEMS Bar Arm)
  string(TOLOWER ${name} file)
  file(READ ${MODELS}/${file}.glb bytes HEX)
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${bytes}")
  string(APPEND text "static const unsigned char bytesOf${name}[] = {${bytes}};\n"
    "const std::span<const std::byte> embedded${name} = std::as_bytes(std::span(bytesOf${name}));\n")
endforeach()
file(WRITE ${OUTPUT} "${text}}  // namespace dermis::cli\n")
