# Flags that let a compiler ignore NaN: Dermis' sources must refuse them, its public headers must not, and every source file that
# computes must include this check. Subprojects are tested by package.subproject.
include(${CMAKE_CURRENT_LIST_DIR}/package_test.cmake)

set(flags -std=c++20 -I "${sourceFolder}/engine/include" -I "${sourceFolder}/engine/src" -I "${coreFolder}"
    -I "${sourceFolder}/shaders")
foreach(flag IN ITEMS -ffast-math -Ofast -ffinite-math-only -D_M_FP_FAST)
  say("Preprocess with ${flag}")
  execute_process(COMMAND "${ownCompiler}" ${flags} ${flag} -M "${coreFolder}/validate.cpp" RESULT_VARIABLE status OUTPUT_QUIET
                  ERROR_VARIABLE printed)
  if(status EQUAL 0 OR NOT printed MATCHES "Dermis: compile without -ffast-math")
    wrong("validate.cpp was accepted, or failed for another reason:\n${printed}")
  endif()
endforeach()
say("Preprocess as for the x87 unit")
set(x87 -U__FLT_EVAL_METHOD__ -D__FLT_EVAL_METHOD__=2)
execute_process(COMMAND "${ownCompiler}" ${flags} ${x87} -M "${coreFolder}/validate.cpp" RESULT_VARIABLE status OUTPUT_QUIET
                ERROR_VARIABLE printed)
if(status EQUAL 0 OR NOT printed MATCHES "Dermis: compile for SSE2")
  wrong("validate.cpp was accepted, or failed for another reason:\n${printed}")
endif()
run(ignored "Compile a program of an engine for it" "${ownCompiler}" ${flags} -fsyntax-only ${x87} -include
    "${sourceFolder}/engine/include/dermis/scene.h" -x c++ /dev/null)
run(ignored "Compile a program of an engine with -ffast-math" "${ownCompiler}" ${flags} -fsyntax-only -ffast-math -include
    "${sourceFolder}/engine/include/dermis/scene.h" -x c++ /dev/null)
run(ignored "Preprocess without" "${ownCompiler}" ${flags} -M "${coreFolder}/validate.cpp")

say("Look for sources that compute and do not refuse these flags")
file(GLOB_RECURSE sources "${sourceFolder}/engine/src/core/*.cpp" "${sourceFolder}/engine/src/cpu/*.cpp" "${sourceFolder}/engine/src/cpu/kernels_inl.h"
     "${sourceFolder}/engine/src/verify/*.cpp" "${sourceFolder}/engine/src/gltf/*.cpp")
set(forgetful)
foreach(file IN LISTS sources)
  file(READ "${file}" text)
  if(text MATCHES "[^A-Za-z_](float|double)[^A-Za-z_0-9]|<cmath>" AND NOT text MATCHES "#include \"cpu/kernels_inl.h\"" AND NOT text MATCHES "#include \"strict_floating_point.h\"")
    list(APPEND forgetful "${file}")
  endif()
endforeach()
if(forgetful)
  wrong("strict_floating_point.h is missing in: ${forgetful}")
endif()

# cmake/DermisTarget.cmake has flags for several compilers. Those that can be tested here must undo the fast-math flags.
set(strictFlags ${dermisGnuFlags})
list(FILTER strictFlags INCLUDE REGEX "^-f")
foreach(flag IN ITEMS -ffast-math -Ofast "-ffinite-math-only;-fno-signed-zeros")
  run(macros "Look at the macros after ${flag} and Dermis' flags" "${ownCompiler}" -std=c++20 ${flag} ${strictFlags} -dM -E -x c++ /dev/null)
  if(macros MATCHES "__FAST_MATH__|__FINITE_MATH_ONLY__ [^0]|__NO_SIGNED_ZEROS__|__ASSOCIATIVE_MATH__|__RECIPROCAL_MATH__")
    wrong("${flag} is still on: ${CMAKE_MATCH_0}")
  endif()
endforeach()
if(clang)
  set(clangCl "${clang}" --driver-mode=cl --target=x86_64-pc-windows-msvc)
  run(ignored "clang-cl knows its flags" ${clangCl} /WX ${dermisClangClFlags} /clang:-std=c++20 /clang:-fsyntax-only
      -- "${scriptFolder}/consumers/headers/empty.cpp")
  run(macros "Look at its macros after /fp:fast" ${clangCl} /fp:fast ${dermisClangClFlags} /clang:-dM /E
      -- "${scriptFolder}/consumers/headers/empty.cpp")
  if(NOT macros MATCHES "__FINITE_MATH_ONLY__ 0" OR macros MATCHES "__FAST_MATH__|_M_FP_FAST")
    wrong("/fp:fast is still on")
  endif()
endif()
