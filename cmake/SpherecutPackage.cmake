# cpack: a Debian package of what is built, and (cpack --config CPackSourceConfig.cmake) an archive of the sources.
# docs/packaging.md.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME spherecut)
set(CPACK_PACKAGE_VENDOR "The Spherecut maintainers")
set(CPACK_PACKAGE_CONTACT "The Spherecut maintainers <maintainers@spherecut.invalid>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "${PROJECT_DESCRIPTION}")
set(CPACK_PACKAGE_DESCRIPTION "The program spherecut with its scenarios and the page of its viewer, the Python package,
the static libraries with headers and CMake package, and the documentation.")
set(CPACK_RESOURCE_FILE_LICENSE "${PROJECT_SOURCE_DIR}/LICENSE")
set(CPACK_RESOURCE_FILE_README "${PROJECT_SOURCE_DIR}/README.md")
set(CPACK_STRIP_FILES ON)
set(CPACK_PACKAGE_CHECKSUM SHA256)
set(CPACK_VERBATIM_VARIABLES ON)

set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)
# The libraries come from dpkg-shlibdeps. Besides them: what draws figures, with its letters.
set(CPACK_DEBIAN_PACKAGE_DEPENDS "gnuplot-nox | gnuplot-qt | gnuplot-x11, fonts-dejavu-core")
# What programs of one's own are built with (docs/library.md).
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "g++, cmake, libeigen3-dev, libcgal-dev, libopenvdb-dev, libtbb-dev, libfcl-dev, voro++-dev, libsuitesparse-dev, libopenblas-dev, liblapack-dev, libtomlplusplus-dev, nlohmann-json3-dev, libfmt-dev")
if(TARGET spherecut_python)
  # The compiled module is for one Python and numpy's interface. The program does without.
  math(EXPR next_minor "${Python3_VERSION_MINOR} + 1")
  set(CPACK_DEBIAN_PACKAGE_RECOMMENDS
    "python3 (>= ${Python3_VERSION_MAJOR}.${Python3_VERSION_MINOR}), python3 (<< ${Python3_VERSION_MAJOR}.${next_minor}), python3-numpy")
  string(APPEND CPACK_DEBIAN_PACKAGE_SUGGESTS ", python3-matplotlib")
endif()
# Debian's Python looks below /usr in another folder than below /usr/local.
set(CPACK_PRE_BUILD_SCRIPTS "${PROJECT_SOURCE_DIR}/cmake/PackageLayout.cmake")
set(CPACK_SPHERECUT_PYTHON_FOLDER "${SPHERECUT_PYTHON_FOLDER}")

set(CPACK_SOURCE_GENERATOR TGZ)
set(CPACK_SOURCE_PACKAGE_FILE_NAME "spherecut-${PROJECT_VERSION}-source")
string(REGEX REPLACE "([][+.*()^$?|\\\\])" "\\\\\\1" source "${PROJECT_SOURCE_DIR}")
set(CPACK_SOURCE_IGNORE_FILES "^${source}/(build|out|\\.git|\\.cache|\\.mypy_cache|\\.pytest_cache|env)(/|$)" "/node_modules/" "/__pycache__/" "/compile_commands\\.json$"
  "\\.egg-info/" "\\.pyc$")
include(CPack)
