# The recipes for vcpkg and Conan can be read, and name only options of Dermis. No recipe is run: both tools download.
include(${CMAKE_CURRENT_LIST_DIR}/package_test.cmake)

set(folder "${sourceFolder}/cmake/recipes")
file(READ "${sourceFolder}/cmake/DermisOptions.cmake" known)

# expect_options(TEXT): all that begin with DERMIS_ are options.
function(expect_options text)
  string(REGEX MATCHALL "DERMIS_[A-Z_]*[A-Z]" names "${text}")
  list(REMOVE_DUPLICATES names)
  list(LENGTH names count)
  if(count LESS 6)
    wrong("only ${count} options: ${names}")
  endif()
  foreach(name IN LISTS names)
    if(NOT known MATCHES "option\\(${name} ")
      wrong("${name} is no option")
    endif()
  endforeach()
endfunction()

# The port, with vcpkg's functions noting what they are called with.
set(VERSION ${version})
set(CURRENT_PACKAGES_DIR "${testFolder}/${NAME}.port")
set(CMAKE_CURRENT_LIST_DIR "${folder}/vcpkg/dermis")
set(called)
foreach(function IN ITEMS vcpkg_extract_source_archive vcpkg_check_features vcpkg_cmake_configure vcpkg_cmake_install
    vcpkg_cmake_config_fixup vcpkg_fixup_pkgconfig vcpkg_install_copyright)
  cmake_language(EVAL CODE "macro(${function})\n  list(APPEND called ${function} \${ARGN})\nendmacro()")
endforeach()
include("${folder}/vcpkg/dermis/portfile.cmake")
expect_options("${called}")
if(NOT called MATCHES "dermis-${version}.tar.gz" OR NOT called MATCHES "vcpkg_install_copyright")
  wrong("the port calls ${called}")
endif()
file(READ "${folder}/vcpkg/dermis/vcpkg.json" manifest)
string(JSON manifestVersion GET "${manifest}" version)
string(JSON features LENGTH "${manifest}" features)
if(NOT manifestVersion STREQUAL version OR NOT features EQUAL 4)
  wrong("vcpkg.json has version ${manifestVersion} and ${features} features")
endif()

find_program(python python3)
if(python)
  file(WRITE "${testFolder}/${NAME}.py" "# Runs the recipe with a Conan that notes what it is told.
import runpy, sys, types
for name in ('conan', 'conan.tools', 'conan.tools.cmake', 'conan.tools.files'):
    sys.modules[name] = types.ModuleType(name)
class Base:
    pass
sys.modules['conan'].ConanFile = Base
variables = {}
class Toolchain:
    def __init__(self, recipe):
        self.cache_variables = variables
    def generate(self):
        pass
for name in ('CMake', 'CMakeDeps', 'cmake_layout'):
    setattr(sys.modules['conan.tools.cmake'], name, lambda *ignored: types.SimpleNamespace(generate=lambda: None))
sys.modules['conan.tools.cmake'].CMakeToolchain = Toolchain
sys.modules['conan.tools.files'].copy = lambda *ignored: None
sys.modules['conan.tools.files'].load = lambda recipe, path: open(path).read()
recipe = runpy.run_path(sys.argv[1])['DermisRecipe']()
recipe.recipe_folder = sys.argv[2]
recipe.export_sources_folder = ''
class Options(dict):
    __getattr__ = dict.get
    get_safe = dict.get
recipe.options = Options({name: True for name in recipe.options})
required = []
recipe.requires = lambda what, **ignored: required.append(what)
recipe.set_version()
recipe.export_sources()
recipe.requirements()
recipe.generate()
print(recipe.version, len(required), *variables)
")
  run(printed "Run the recipe for Conan" "${python}" "${testFolder}/${NAME}.py" "${folder}/conan/conanfile.py" "${folder}/conan")
  if(NOT printed MATCHES "^${version} 7 ")
    wrong("it says ${printed}")
  endif()
  expect_options("${printed}")
  run(ignored "Read the workflow" "${python}" -c "
import sys
text = open(sys.argv[1]).read()
assert '\\t' not in text
try:
    import yaml
except ImportError:
    sys.exit(0)
jobs = yaml.safe_load(text)['jobs']
assert set(jobs) == {'debian', 'clang', 'source_package', 'msvc', 'macos'}, jobs
assert all('steps' in job and 'runs-on' in job for job in jobs.values())
" "${sourceFolder}/.github/workflows/ci.yml")
endif()
