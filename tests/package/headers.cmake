# Includes Dermis' headers before and after those of other libraries, and checks which headers they include. Programs are only
# compiled.
include(${CMAKE_CURRENT_LIST_DIR}/package_test.cmake)

set(core dermis/mesh.h dermis/clips.h dermis/scene.h dermis/cpu.h dermis/verify.h dermis/gltf.h dermis/compilers.h)
set(vulkan dermis/vulkan/context.h dermis/vulkan/scene_recorder.h)
set(loaders dermis/vulkan/drawing.h)
set(create "int main() { return static_cast<int>(vkCreateInstance(nullptr, nullptr, nullptr)); }")

# compiles(WHAT BODY HEADERS...): a "-DX" among the headers is a definition.
function(compiles what body)
  set(text)
  set(flags)
  foreach(header IN LISTS ARGN)
    if(header MATCHES "^-D")
      list(APPEND flags ${header})
    else()
      string(APPEND text "#include <${header}>\n")
    endif()
  endforeach()
  file(WRITE "${testFolder}/${NAME}.cpp" "${text}${body}\n")
  run(ignored "${what}" "${ownCompiler}" -std=c++20 -fsyntax-only -Wall -Wextra -Werror ${flags} -I "${prefix}/${includeFolder}"
      -I "${scriptFolder}/consumers/headers" "${testFolder}/${NAME}.cpp")
endfunction()

if(ORDERS)
  compiles("volk first" "${create}" volk.h ${vulkan} ${loaders})
  compiles("volk last" "${create}" ${vulkan} volk.h)
  compiles("volk last, VK_NO_PROTOTYPES" "${create}" -DVK_NO_PROTOTYPES ${vulkan} ${loaders} volk.h)
  compiles("Xlib and vulkan.h first" "${create}" X11/Xlib.h X11/Xutil.h vulkan/vulkan.h ${core} ${vulkan} ${loaders})
  compiles("vulkan.h last" "${create}" ${vulkan} vulkan/vulkan.h)
  compiles("VK_NO_PROTOTYPES, no Vulkan header" "" -DVK_NO_PROTOTYPES ${vulkan} ${loaders})
  return()
endif()
compiles("vulkan.h and Xlib after all that is Dermis'" "${create}" ${core} ${vulkan} ${loaders} vulkan/vulkan.h X11/Xlib.h)
# After the headers of the standard library, which do not compile with these macros.
compiles("macros of windows.h" "" algorithm array bit cmath cstddef cstdint filesystem functional limits memory optional span string
         string_view utility variant vector vulkan/vulkan.h windows_macros.h ${core} ${vulkan} ${loaders})

# The dependencies of Dermis' sources must not be dependencies of its headers.
say("Look at what the public headers include")
file(GLOB_RECURSE public RELATIVE "${prefix}/${includeFolder}" "${prefix}/${includeFolder}/dermis/*.h")
set(text)
foreach(header IN LISTS public)
  string(APPEND text "#include <${header}>\n")
endforeach()
file(WRITE "${testFolder}/${NAME}.cpp" "${text}")
run(files "List it" "${ownCompiler}" -std=c++20 -M -I "${prefix}/${includeFolder}" "${testFolder}/${NAME}.cpp")
if(NOT files MATCHES "dermis/mesh[.]h" OR files MATCHES "/(glm|hwy|glslang|spirv-tools|nlohmann)/|tiny_gltf[.]h")
  wrong("they include ${CMAKE_MATCH_0}:\n${files}")
endif()
