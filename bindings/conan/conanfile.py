"""The recipe of Conan 2: builds vrtm with cargo, by its CMakeLists.txt, or takes a library that is built already.

conan create bindings/conan
conan create bindings/conan --conf user.vrtm:prebuilt=/.../libvrtm.so
"""

import re
import shutil
from pathlib import Path

from conan import ConanFile
from conan.tools.cmake import CMake, CMakeToolchain, cmake_layout
from conan.tools.scm import Git


class Vrtm(ConanFile):
    name = "vrtm"
    description = "Variable rigidity texture mapping: keeps painted features rigid while the surface under them deforms"
    license = "MIT OR Apache-2.0"
    topics = ("texture", "uv", "deformation", "animation", "graphics")
    package_type = "shared-library"
    settings = "os", "arch", "compiler", "build_type"
    options = {"gpu": [True, False]}  # noqa: RUF012
    default_options = {"gpu": True}  # noqa: RUF012

    def set_version(self):
        text = (Path(self.recipe_folder).parents[1] / "Cargo.toml").read_text("utf-8")
        self.version = re.search(r'^version = "(.*)"', text, re.M)[1]

    def export_sources(self):
        # Cargo wants the whole workspace.
        repository = Path(self.recipe_folder).parents[1]
        for file in Git(self, repository).included_files():
            target = Path(self.export_sources_folder) / file
            if not file.startswith("docs/") and (repository / file).is_file():
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(repository / file, target)

    def package_id(self):
        # It is C, and cargo's profile is the same for each.
        del self.info.settings.compiler
        del self.info.settings.build_type

    def layout(self):
        cmake_layout(self)

    def generate(self):
        toolchain = CMakeToolchain(self)
        toolchain.cache_variables["VRTM_GPU"] = bool(self.options.gpu)
        toolchain.cache_variables["VRTM_PREBUILT"] = self.conf.get("user.vrtm:prebuilt", default="")
        toolchain.generate()

    def build(self):
        cmake = CMake(self)
        cmake.configure()
        cmake.build()

    def package(self):
        CMake(self).install()

    def package_info(self):
        # vrtm's own CMake package and vrtm.pc are in it.
        self.cpp_info.libs = ["vrtm"]
        self.cpp_info.set_property("cmake_find_mode", "none")
        self.cpp_info.builddirs = ["lib/cmake/vrtm"]
        self.cpp_info.set_property("pkg_config_name", "none")
