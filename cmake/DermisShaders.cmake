# Kernels as part of a library: the build compiles, checks and embeds them, or takes them from DERMIS_EMBEDDED_SHADERS.

# dermis_shader_tool(COMMAND DEPENDS): the program that compiles and embeds kernels, and its dependencies.
#
# It is a target of this build, except in two cases: this build cannot run it (cross build), or an engine has its own targets with
# the names that the packages of glslang and SPIRV-Tools use. Then the host's compiler builds it, in a separate build.
function(dermis_shader_tool command depends)
  find_program(DERMIS_SPIRV_VAL spirv-val DOC "SPIRV-Tools' validator, run on each kernel")
  mark_as_advanced(DERMIS_SPIRV_VAL)
  if(NOT DERMIS_SPIRV_VAL)
    message(FATAL_ERROR "Compiling kernels needs spirv-val, SPIRV-Tools and glslang (Debian: spirv-tools, glslang-dev, glslang-tools). "
                        "The source package of Dermis needs none of them: its kernels are compiled")
  endif()
  get_property(isBuiltApart GLOBAL PROPERTY DERMIS_SHADER_TOOL_IS_BUILT_APART)
  if(TARGET dermis_embed_shaders OR isBuiltApart)
    # exists already
  elseif(CMAKE_CROSSCOMPILING OR (NOT DERMIS_BUILD_SHADER_COMPILER AND DERMIS_ENGINE_HAS_GLSLANG))
    dermis_build_shader_tool_apart()
  else()
    add_subdirectory(${PROJECT_SOURCE_DIR}/engine/src/shader_compiler ${PROJECT_BINARY_DIR}/engine/src/shader_compiler)
  endif()
  if(TARGET dermis_embed_shaders)
    set(${command} dermis_embed_shaders PARENT_SCOPE)
    set(${depends} dermis_embed_shaders PARENT_SCOPE)
  else()
    set(${command} ${PROJECT_BINARY_DIR}/shader_tool/engine/src/shader_compiler/dermis_embed_shaders${CMAKE_HOST_EXECUTABLE_SUFFIX} PARENT_SCOPE)
    set(${depends} dermis_shader_tool PARENT_SCOPE)
  endif()
endfunction()

# The target dermis_shader_tool: builds Dermis' shader compiler separately. Only the generator is taken from this build.
function(dermis_build_shader_tool_apart)
  include(ExternalProject)
  set(DERMIS_HOST_CXX "" CACHE STRING "The compiler that builds programs for this machine, in a cross build; empty: c++")
  mark_as_advanced(DERMIS_HOST_CXX)
  set(hostCompiler ${DERMIS_HOST_CXX})
  if(NOT hostCompiler AND CMAKE_CROSSCOMPILING)
    find_program(hostCompiler NAMES c++ g++ clang++ NO_CACHE NO_CMAKE_FIND_ROOT_PATH REQUIRED)
  elseif(NOT hostCompiler)
    set(hostCompiler ${CMAKE_CXX_COMPILER})
  endif()
  set(folder ${PROJECT_BINARY_DIR}/shader_tool)
  set(options)
  foreach(part IN ITEMS VULKAN CPU VERIFY GLTF SAMPLES TESTS)
    list(APPEND options -DDERMIS_BUILD_${part}=OFF)
  endforeach()
  set(program ${folder}/engine/src/shader_compiler/dermis_embed_shaders${CMAKE_HOST_EXECUTABLE_SUFFIX})
  # Environment variables of a cross build are for the other system, and must not affect this build.
  set(clean ${CMAKE_COMMAND} -E env --unset=CXX --unset=CXXFLAGS --unset=LDFLAGS --unset=PKG_CONFIG_LIBDIR)
  ExternalProject_Add(dermis_shader_tool
    SOURCE_DIR ${PROJECT_SOURCE_DIR}
    PREFIX ${folder}.state
    BINARY_DIR ${folder}
    DOWNLOAD_COMMAND ""
    CONFIGURE_COMMAND ${clean} ${CMAKE_COMMAND} -S ${PROJECT_SOURCE_DIR} -B ${folder} -G ${CMAKE_GENERATOR}
      -DCMAKE_MAKE_PROGRAM=${CMAKE_MAKE_PROGRAM} -DCMAKE_CXX_COMPILER=${hostCompiler}
      -DCMAKE_CXX_COMPILER_LAUNCHER=${CMAKE_CXX_COMPILER_LAUNCHER} -DCMAKE_BUILD_TYPE=Release
      -DDERMIS_BUILD_SHADER_COMPILER=ON -DDERMIS_INSTALL=OFF ${options}
    BUILD_COMMAND ${clean} ${CMAKE_COMMAND} --build ${folder} --target dermis_embed_shaders
    INSTALL_COMMAND ""
    BUILD_ALWAYS ON
    BUILD_BYPRODUCTS ${program}
    EXCLUDE_FROM_ALL ON)
  set_property(GLOBAL PROPERTY DERMIS_SHADER_TOOL_IS_BUILT_APART ON)
endfunction()

# dermis_embed_shaders(TARGET name
#                      [NAMESPACE dermis::kernels]       # C++ namespace of the symbols
#                      [ALLOW_CONTRACTION]               # do not demand `precise` everywhere
#                      [RECIPES]                         # also NAME_recipes.h: what each module is compiled from, for
#                                                        # dermis::runtime_compiler
#                      KERNELS "skin.comp TEXELS" ...    # a file, relative to the current source folder (or .vert,
#                                                        # .frag), and the macros that this module is compiled with;
#                                                        # --scalar-block-layout among them: blocks may have that layout,
#                                                        # which devices must have enabled; --unless=MACRO: C++ that
#                                                        # has the macro leaves the module out
#                      [INCLUDES abi.h ...]              # shown in an IDE; dependencies are found
#                      [INCLUDE_FOLDERS folder ...]      # where #include is looked up as well
#                      [DEFINES NAME=VALUE ...])
#
# Makes the OBJECT library `name`, with the header name.h, which declares for each kernel
#
#     namespace dermis::kernels { extern const std::span<const std::uint32_t> skin_texels_spirv; }
#
# with the macros in lower case behind the name of the file, `mesh_vert_spirv` for mesh.vert (the two stages of a pipeline have
# one name), and a look-up by name for all of them:
#
#     std::span<const std::uint32_t> dermis::kernels::find(std::string_view name);   // "skin_texels"; empty: there is none
#
# Where DERMIS_EMBEDDED_SHADERS has name.h and name.cpp, nothing is compiled: they are taken.
#
# A kernel is compiled again when it or a file that it includes changes. It has to pass the compiler,
# the check that all arithmetic is decorated NoContraction, and spirv-val for Vulkan 1.1.
#
# dermis_link_shaders(library name) puts the objects into a library. Its objects, and not the library,
# because a static library that is exported must have all that it links exported too, even privately.
function(dermis_embed_shaders)
  cmake_parse_arguments(PARSE_ARGV 0 arg "ALLOW_CONTRACTION;RECIPES" "TARGET;NAMESPACE"
                        "KERNELS;INCLUDES;INCLUDE_FOLDERS;DEFINES")
  if(NOT arg_TARGET OR NOT arg_KERNELS OR arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "dermis_embed_shaders(TARGET name KERNELS file...): wrong arguments '${ARGN}'")
  endif()
  if(NOT arg_NAMESPACE)
    set(arg_NAMESPACE dermis::kernels)
  endif()

  # Stores the name and source of each module, and how it is compiled in macros_NAME, layoutFlags_NAME and unless_NAME.
  set(names)
  set(sources)
  set(recipes)
  foreach(entry IN LISTS arg_KERNELS)
    separate_arguments(macros UNIX_COMMAND "${entry}")
    list(POP_FRONT macros kernel)
    set(layoutFlags)
    set(isScalar false)
    if("--scalar-block-layout" IN_LIST macros)
      list(REMOVE_ITEM macros "--scalar-block-layout")
      set(layoutFlags --scalar-block-layout)
      set(isScalar true)
    endif()
    set(unless ${macros})
    list(FILTER unless INCLUDE REGEX "^--unless=")
    list(FILTER macros EXCLUDE REGEX "^--unless=")
    list(TRANSFORM unless REPLACE "^--unless=" "")
    cmake_path(GET kernel STEM LAST_ONLY stem)
    cmake_path(GET kernel EXTENSION LAST_ONLY extension)
    if(NOT extension STREQUAL ".comp")
      string(APPEND stem ${extension})
    endif()
    list(JOIN macros "_" suffix)
    if(suffix)
      string(TOLOWER "_${suffix}" suffix)
    endif()
    string(MAKE_C_IDENTIFIER "${stem}${suffix}" name)
    list(APPEND names ${name})
    list(APPEND sources ${kernel})
    set(macros_${name} ${macros})
    set(layoutFlags_${name} ${layoutFlags})
    set(unless_${name} ${unless})
    string(APPEND recipes "    {\"${name}\", \"${kernel}\", \"${macros}\", ${isScalar}},\n")
  endforeach()

  set(folder ${CMAKE_CURRENT_BINARY_DIR}/${arg_TARGET})
  file(MAKE_DIRECTORY ${folder})
  if(arg_RECIPES)
    string(REPLACE ";" " " recipes "${recipes}")
    file(CONFIGURE OUTPUT ${folder}/${arg_TARGET}_recipes.h @ONLY CONTENT
"// Made by cmake/DermisShaders.cmake.
#pragma once

namespace @arg_NAMESPACE@ {

struct Recipe {
  const char* name;    // of the module
  const char* source;  // the file
  const char* macros;  // that it is compiled with, separated by blanks
  bool scalarBlockLayout;
};

inline constexpr Recipe recipes[] = {
@recipes@};

}  // namespace @arg_NAMESPACE@
")
  endif()

  if(DERMIS_EMBEDDED_SHADERS AND EXISTS ${DERMIS_EMBEDDED_SHADERS}/${arg_TARGET}.cpp)
    add_library(${arg_TARGET} OBJECT ${DERMIS_EMBEDDED_SHADERS}/${arg_TARGET}.cpp ${DERMIS_EMBEDDED_SHADERS}/${arg_TARGET}.h)
    dermis_configure_target(${arg_TARGET})
    target_include_directories(${arg_TARGET} INTERFACE ${DERMIS_EMBEDDED_SHADERS} ${folder})
    return()
  endif()

  dermis_shader_tool(tool toolDepends)
  set(flags)
  if(NOT arg_ALLOW_CONTRACTION)
    list(APPEND flags --require-no-contraction)
  endif()
  foreach(includeFolder IN LISTS arg_INCLUDE_FOLDERS)
    cmake_path(ABSOLUTE_PATH includeFolder BASE_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR} NORMALIZE)
    list(APPEND flags --include ${includeFolder})
  endforeach()
  foreach(define IN LISTS arg_DEFINES)
    list(APPEND flags --define ${define})
  endforeach()

  set(modules)
  set(moduleFlags)
  foreach(name kernel IN ZIP_LISTS names sources)
    set(ownFlags ${flags} ${layoutFlags_${name}})
    foreach(macro IN LISTS macros_${name})
      list(APPEND ownFlags --define ${macro})
    endforeach()
    cmake_path(ABSOLUTE_PATH kernel BASE_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR} NORMALIZE)
    set(module ${folder}/${name}.spv)
    # A module gets its name only after spirv-val has accepted it, so that a failed build does not
    # leave an invalid one behind.
    set(unchecked ${folder}/${name}.unchecked.spv)
    add_custom_command(
      OUTPUT ${module}
      COMMAND ${tool} compile --input ${kernel} --output ${unchecked} ${ownFlags}
              --depfile ${module}.d --depfile-target ${module}
      COMMAND ${DERMIS_SPIRV_VAL} ${layoutFlags_${name}} --target-env vulkan1.1 ${unchecked}
      COMMAND ${CMAKE_COMMAND} -E rename ${unchecked} ${module}
      DEPENDS ${toolDepends} ${kernel}
      DEPFILE ${module}.d
      COMMENT "Compiling kernel ${name}"
      VERBATIM)
    list(APPEND modules ${module})
    list(APPEND moduleFlags --module ${name}=${module})
    foreach(macro IN LISTS unless_${name})
      list(APPEND moduleFlags --unless ${macro})
    endforeach()
  endforeach()

  set(header ${folder}/${arg_TARGET}.h)
  set(source ${folder}/${arg_TARGET}.cpp)
  add_custom_command(
    OUTPUT ${header} ${source}
    COMMAND ${tool} embed --namespace ${arg_NAMESPACE} --header ${header}
            --source ${source} ${moduleFlags}
    DEPENDS ${toolDepends} ${modules}
    COMMENT "Embedding the kernels of ${arg_TARGET}"
    VERBATIM)

  add_library(${arg_TARGET} OBJECT ${source} ${header})
  dermis_configure_target(${arg_TARGET})
  target_include_directories(${arg_TARGET} INTERFACE ${folder})
  list(REMOVE_DUPLICATES sources)
  set(shown ${sources} ${arg_INCLUDES})
  target_sources(${arg_TARGET} PRIVATE ${shown})
  set_source_files_properties(${shown} PROPERTIES HEADER_FILE_ONLY ON)
endfunction()

# dermis_link_shaders(LIBRARY SHADERS): see above. LIBRARY's sources can include SHADERS.h.
function(dermis_link_shaders library shaders)
  target_sources(${library} PRIVATE $<TARGET_OBJECTS:${shaders}>)
  target_include_directories(${library} PRIVATE
    $<BUILD_INTERFACE:$<TARGET_PROPERTY:${shaders},INTERFACE_INCLUDE_DIRECTORIES>>)
  add_dependencies(${library} ${shaders})  # the header must exist before LIBRARY is compiled
endfunction()
