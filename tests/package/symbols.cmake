# dermis::core, dermis::verify and dermis::vulkan must not link a Vulkan loader, throw exceptions, have writable global data, or
# contain functions of GLM whose behavior depends on the engine's settings of GLM.
include(${CMAKE_CURRENT_LIST_DIR}/package_test.cmake)

foreach(component IN ITEMS core verify vulkan)
  set(library "${prefix}/${libFolder}/libdermis_${component}.a")
  # System V format: name|value|class|type|size|line|section
  run(symbols "List the symbols of libdermis_${component}.a" "${nm}" --format=sysv "${library}")
  string(REGEX MATCHALL "[^\n]*[|][^\n]*" lines "${symbols}")
  list(LENGTH lines count)
  if(count LESS 50)
    wrong("${nm} lists only ${count} symbols:\n${symbols}")
  endif()

  # Constants are in .rodata, or in .data.rel.ro if the loader fills in addresses and then write-protects them. Nothing is in .data,
  # .bss or thread-local storage, not even a guard variable.
  set(problems)
  foreach(line IN LISTS lines)
    if(line MATCHES "[|] *(\\.data|\\.bss|\\.tdata|\\.tbss|\\*COM\\*|\\.init_array|\\.ctors)[^|]*$"
       AND line MATCHES "OBJECT|TLS|FUNC" AND NOT line MATCHES "[|] *\\.data\\.rel\\.ro[^|]*$")
      string(APPEND problems "\n  can be written to: ${line}")
    elseif(line MATCHES "^(vk[A-Z][A-Za-z0-9]*|dlopen|dlsym) *[|].*UND")
      string(APPEND problems "\n  is linked: ${line}")
    elseif(line MATCHES "^(__cxa_throw|__cxa_begin_catch|__dynamic_cast) *[|]")
      string(APPEND problems "\n  exceptions or run-time types: ${line}")
    elseif(line MATCHES "^_ZN?K?3glm.*3qua")
      string(APPEND problems "\n  depends on GLM_FORCE_QUAT_DATA_WXYZ: ${line}")
    endif()
  endforeach()
  if(problems)
    wrong("libdermis_${component}.a:${problems}")
  endif()
endforeach()
