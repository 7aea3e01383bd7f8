# Kernels as part of a library: compiled, checked and embedded by the build.

find_program(DERMIS_SPIRV_VAL spirv-val REQUIRED DOC "SPIRV-Tools' validator, run on each kernel")
mark_as_advanced(DERMIS_SPIRV_VAL)

# dermis_embed_shaders(TARGET name
#                      [NAMESPACE dermis::kernels]       # C++ namespace of the symbols
#                      [ALLOW_CONTRACTION]               # do not demand `precise` everywhere
#                      KERNELS "skin.comp TEXELS" ...    # a file, relative to the current source folder (or .vert,
#                                                        # .frag), and the macros that this module is compiled with;
#                                                        # --scalar-block-layout among them: blocks may have that layout,
#                                                        # which devices must have enabled
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
# A kernel is compiled again when it or a file that it includes changes. It has to pass the compiler,
# the check that all arithmetic is decorated NoContraction, and spirv-val for Vulkan 1.1.
#
# dermis_link_shaders(library name) puts the objects into a library. Its objects, and not the library,
# because a static library that is exported must have all that it links exported too, even privately.
function(dermis_embed_shaders)
  cmake_parse_arguments(PARSE_ARGV 0 arg "ALLOW_CONTRACTION" "TARGET;NAMESPACE"
                        "KERNELS;INCLUDES;INCLUDE_FOLDERS;DEFINES")
  if(NOT arg_TARGET OR NOT arg_KERNELS OR arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "dermis_embed_shaders(TARGET name KERNELS file...): wrong arguments '${ARGN}'")
  endif()
  if(NOT arg_NAMESPACE)
    set(arg_NAMESPACE dermis::kernels)
  endif()

  set(folder ${CMAKE_CURRENT_BINARY_DIR}/${arg_TARGET})
  file(MAKE_DIRECTORY ${folder})
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
  set(sources)
  foreach(entry IN LISTS arg_KERNELS)
    separate_arguments(macros UNIX_COMMAND "${entry}")
    list(POP_FRONT macros kernel)
    list(APPEND sources ${kernel})
    set(ownFlags ${flags})
    set(layoutFlags)
    if("--scalar-block-layout" IN_LIST macros)
      list(REMOVE_ITEM macros "--scalar-block-layout")
      set(layoutFlags --scalar-block-layout)
    endif()
    foreach(macro IN LISTS macros)
      list(APPEND ownFlags --define ${macro})
    endforeach()
    cmake_path(ABSOLUTE_PATH kernel BASE_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR} NORMALIZE)
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
    set(module ${folder}/${name}.spv)
    # Only a module that spirv-val accepts gets its name: a failed build does not leave one behind.
    set(unchecked ${folder}/${name}.unchecked.spv)
    add_custom_command(
      OUTPUT ${module}
      COMMAND dermis_embed_shaders compile --input ${kernel} --output ${unchecked} ${ownFlags} ${layoutFlags}
              --depfile ${module}.d --depfile-target ${module}
      COMMAND ${DERMIS_SPIRV_VAL} ${layoutFlags} --target-env vulkan1.1 ${unchecked}
      COMMAND ${CMAKE_COMMAND} -E rename ${unchecked} ${module}
      DEPENDS dermis_embed_shaders ${kernel}
      DEPFILE ${module}.d
      COMMENT "Compiling kernel ${name}"
      VERBATIM)
    list(APPEND modules ${module})
    list(APPEND moduleFlags --module ${name}=${module})
  endforeach()

  set(header ${folder}/${arg_TARGET}.h)
  set(source ${folder}/${arg_TARGET}.cpp)
  add_custom_command(
    OUTPUT ${header} ${source}
    COMMAND dermis_embed_shaders embed --namespace ${arg_NAMESPACE} --header ${header}
            --source ${source} ${moduleFlags}
    DEPENDS dermis_embed_shaders ${modules}
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
  add_dependencies(${library} ${shaders})  # The header has to be there before LIBRARY is compiled.
endfunction()
