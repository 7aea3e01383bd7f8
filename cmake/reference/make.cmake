# Makes the reference with doxygen, as HTML in OUTPUT/html. Fails on any warning.
#
#   cmake -D DOXYGEN=... -D SOURCE=... -D OUTPUT=... -D VERSION=... -P cmake/reference/make.cmake
#
# DOXYGEN: the program. If it was not found, the script prints "SKIPPED: " and the reason; with CI set in the environment it fails.
#
# A class, structure, enumeration, type, function or constant without documentation counts as a warning, too. Data members,
# enumerators, comparisons, special member functions (destructors, copies and moves) and Vulkan's types may do without.
cmake_minimum_required(VERSION 3.25)

if(NOT DOXYGEN)
  if("$ENV{CI}" STREQUAL "")
    message("SKIPPED: doxygen is not installed")
    return()
  endif()
  message(FATAL_ERROR "doxygen is not installed, and CI is set")
endif()

file(REMOVE_RECURSE ${OUTPUT})
file(MAKE_DIRECTORY ${OUTPUT})
set(ENV{DERMIS_REFERENCE} ${OUTPUT})
set(ENV{DERMIS_VERSION} ${VERSION})
set(warnings)

# run(CONFIGURATION PERMITTED): appends to `warnings` the lines that doxygen prints, except those that match PERMITTED.
function(run configuration permitted)
  execute_process(COMMAND ${DOXYGEN} ${configuration} WORKING_DIRECTORY ${SOURCE}
                  OUTPUT_VARIABLE output ERROR_VARIABLE output RESULT_VARIABLE status)
  if(NOT status EQUAL 0)
    message(FATAL_ERROR "doxygen failed (${status}):\n${output}")
  endif()
  string(REGEX REPLACE "[][;]" "_" output "${output}")  # which split lists
  string(REPLACE "\n" ";" lines "${output}")
  list(REMOVE_ITEM lines "")
  if(permitted)
    list(FILTER lines EXCLUDE REGEX "${permitted}")
  endif()
  set(warnings ${warnings} ${lines} PARENT_SCOPE)
endfunction()

run(cmake/reference/Doxyfile "")
if(NOT EXISTS ${OUTPUT}/html/index.html)
  message(FATAL_ERROR "doxygen made no ${OUTPUT}/html/index.html")
endif()

file(WRITE ${OUTPUT}/undocumented
  "@INCLUDE = cmake/reference/Doxyfile\nWARN_IF_UNDOCUMENTED = YES\nGENERATE_HTML = NO\nGENERATE_XML = YES\n")
set(members "\\(variable\\) of (struct|class)|\\((enumvalue|friend)\\)")
set(special "Member (~[A-Za-z]+\\(\\)|operator=\\(|([A-Za-z]+)\\((const )?[A-Za-z]+ &&?\\))")
set(vulkan "Member (Vk|PFN_vk)[A-Za-z]+ \\(typedef\\)")
run(${OUTPUT}/undocumented "(${members}|${special}|${vulkan}).* is not documented")

if(warnings)
  list(LENGTH warnings count)
  list(JOIN warnings "\n" text)
  message("${text}")
  message(FATAL_ERROR "doxygen has ${count} warnings")
endif()
