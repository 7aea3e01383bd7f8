"""A recipe for Conan 2. It builds the source package (cmake --build BUILD --target source_package), which contains the compiled kernels
and needs no glslang. Unpack dermis-VERSION.tar.gz, then:

    conan create dermis-VERSION/cmake/recipes/conan -o "dermis/*:gltf=True"
"""
import os
import re

from conan import ConanFile
from conan.tools.cmake import CMake, CMakeDeps, CMakeToolchain, cmake_layout
from conan.tools.files import copy, load

required_conan_version = ">=2.0"


class DermisRecipe(ConanFile):
    name = "dermis"
    description = "Skinning with dual quaternions in Vulkan compute shaders"
    license = "MIT"
    package_type = "library"
    settings = "os", "arch", "compiler", "build_type"
    options = {name: [True, False] for name in ("shared", "fPIC", "cpu", "verify", "gltf", "c")}
    default_options = {"shared": False, "fPIC": True, "cpu": True, "verify": False, "gltf": False, "c": False}
    implements = ["auto_shared_fpic"]

    @property
    def _root(self):
        """The folder of the source package, which this recipe is in."""
        return os.path.abspath(os.path.join(self.recipe_folder, "..", "..", ".."))

    def set_version(self):
        header = load(self, os.path.join(self._root, "engine", "include", "dermis", "result.h"))
        self.version = ".".join(re.findall(r"#define DERMIS_VERSION_(?:MAJOR|MINOR|PATCH) (\d+)", header))

    def export_sources(self):
        for pattern in ("CMakeLists.txt", "LICENSE", "*.md", "cmake/*", "docs/*", "engine/*", "samples/*", "shaders/*"):
            copy(self, pattern, self._root, self.export_sources_folder)

    def requirements(self):
        self.requires("vulkan-headers/[>=1.3]", transitive_headers=True)
        if self.options.cpu:
            self.requires("highway/[>=1.0.3]")
        if self.options.verify:
            self.requires("glm/[>=0.9.9 <2]")
        if self.options.gltf:
            self.requires("tinygltf/[>=2.8]")
            self.requires("nlohmann_json/[>=3.11]")
            self.requires("meshoptimizer/[>=0.18]")
            self.requires("draco/[>=1.5]")

    def layout(self):
        cmake_layout(self)

    def generate(self):
        CMakeDeps(self).generate()
        toolchain = CMakeToolchain(self)
        for name in ("cpu", "verify", "gltf", "c"):
            toolchain.cache_variables[f"DERMIS_BUILD_{name.upper()}"] = bool(self.options.get_safe(name))
        for name in ("SAMPLES", "TESTS"):
            toolchain.cache_variables[f"DERMIS_BUILD_{name}"] = False
        for name in ("MESHOPTIMIZER", "DRACO"):
            toolchain.cache_variables[f"DERMIS_{name}"] = bool(self.options.gltf)
        toolchain.generate()

    def build(self):
        cmake = CMake(self)
        cmake.configure()
        cmake.build()

    def package(self):
        copy(self, "LICENSE", self.source_folder, os.path.join(self.package_folder, "licenses"))
        CMake(self).install()

    def package_info(self):
        # Dermis' own CMake package has the targets.
        self.cpp_info.set_property("cmake_find_mode", "none")
        self.cpp_info.builddirs = [os.path.join("lib", "cmake", "dermis")]
