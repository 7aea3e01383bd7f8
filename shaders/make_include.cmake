# Makes one GLSL file that an engine can include. Replaces the first #include of each file by its text, and removes the others. Puts
# `dermis_` before the name of every function, struct and constant that does not begin with "dermis", "Dermis" or "DERMIS" already.
#
#   cmake -DINPUT=shaders/skin_include.glsl -DOUTPUT=dermis_skin.glsl -P make_include.cmake
#
# Finds a declaration only at the beginning of a line. In the kernels' sources, the declaration of every function, struct and global
# constant begins a line.

cmake_minimum_required(VERSION 3.25)
get_filename_component(folder ${INPUT} DIRECTORY)

# CMake would split the text at semicolons, and treats brackets specially.
function(read_source path result)
  file(READ ${path} text)
  string(REPLACE ";" "@semicolon@" text "${text}")
  string(REPLACE "[" "@open@" text "${text}")
  string(REPLACE "]" "@close@" text "${text}")
  set(${result} "${text}" PARENT_SCOPE)
endfunction()

read_source(${INPUT} text)
set(included)
while(text MATCHES "#include \"([A-Za-z_.]+)\"")
  set(name ${CMAKE_MATCH_1})
  set(own "")
  if(NOT name IN_LIST included)
    list(APPEND included ${name})
    read_source(${folder}/${name} own)
  endif()
  # Replaces the first occurrence. Later ones are replaced by nothing, because the file is in `included`.
  string(FIND "${text}" "#include \"${name}\"" begin)
  string(LENGTH "#include \"${name}\"" length)
  math(EXPR end "${begin} + ${length}")
  string(SUBSTRING "${text}" 0 ${begin} before)
  string(SUBSTRING "${text}" ${end} -1 after)
  set(text "${before}${own}${after}")
endwhile()

string(REGEX MATCHALL "\n(struct|DERMIS_CONSTANT|const [a-z]+|[A-Za-z][A-Za-z0-9]*) [A-Za-z_][A-Za-z0-9_]*( =|\\(| {)" declarations "${text}")
set(names)
foreach(declaration IN LISTS declarations)
  string(REGEX REPLACE "^.* ([A-Za-z_][A-Za-z0-9_]*)( =|\\(| {)$" "\\1" name "${declaration}")
  if(NOT name MATCHES "^([Dd]ermis|DERMIS)" AND NOT declaration MATCHES "using ") # which is C++
    list(APPEND names ${name})
  endif()
endforeach()
list(REMOVE_DUPLICATES names)
set(text " ${text} ")
foreach(name IN LISTS names)
  # Two passes: a match consumes the character after the name, so the first pass misses an adjacent name.
  foreach(pass RANGE 1)
    string(REGEX REPLACE "([^A-Za-z0-9_])${name}([^A-Za-z0-9_])" "\\1dermis_${name}\\2" text "${text}")
  endforeach()
endforeach()
string(STRIP "${text}" text)
# A shader may also include abi.h, which declares the same names without the prefix.
string(REPLACE "DERMIS_ABI_H" "DERMIS_SKIN_ABI_H" text "${text}")

string(REPLACE "@open@" "[" text "${text}")
string(REPLACE "@close@" "]" text "${text}")
string(REPLACE "@semicolon@" ";" text "${text}")
file(WRITE ${OUTPUT} "${text}\n")
