# Installation and the package that find_package(spherecut) reads.
include(CMakePackageConfigHelpers)
set(SPHERECUT_PACKAGE_FOLDER "${CMAKE_INSTALL_LIBDIR}/cmake/spherecut")

install(TARGETS spherecut_topology spherecut_solvers spherecut_app spherecut_options spherecut_suitesparse spherecut_mumps spherecut_voro
  EXPORT spherecutTargets ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}")
install(EXPORT spherecutTargets NAMESPACE spherecut:: DESTINATION "${SPHERECUT_PACKAGE_FOLDER}")
install(TARGETS spherecut RUNTIME DESTINATION "${CMAKE_INSTALL_BINDIR}")
install(DIRECTORY topology solvers src DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}/spherecut" FILES_MATCHING PATTERN "*.hpp"
  PATTERN page EXCLUDE)
install(DIRECTORY "${SPHERECUT_PAGE_FOLDER}/" DESTINATION "${CMAKE_INSTALL_DATADIR}/spherecut/page" OPTIONAL)
install(DIRECTORY scenarios DESTINATION "${CMAKE_INSTALL_DATADIR}/spherecut" FILES_MATCHING PATTERN "*.toml")
install(FILES LICENSE DESTINATION "${CMAKE_INSTALL_DOCDIR}")

configure_package_config_file(cmake/spherecutConfig.cmake.in "${PROJECT_BINARY_DIR}/spherecutConfig.cmake"
  INSTALL_DESTINATION "${SPHERECUT_PACKAGE_FOLDER}")
write_basic_package_version_file("${PROJECT_BINARY_DIR}/spherecutConfigVersion.cmake" COMPATIBILITY SameMinorVersion)
install(FILES "${PROJECT_BINARY_DIR}/spherecutConfig.cmake" "${PROJECT_BINARY_DIR}/spherecutConfigVersion.cmake"
  DESTINATION "${SPHERECUT_PACKAGE_FOLDER}")
