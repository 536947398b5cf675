# Installation and the package that find_package(spherecut) reads.
include(CMakePackageConfigHelpers)
set(SPHERECUT_PACKAGE_FOLDER "${CMAKE_INSTALL_LIBDIR}/cmake/spherecut")

install(TARGETS spherecut_topology spherecut_solvers spherecut_app spherecut_live spherecut_options spherecut_suitesparse spherecut_voro
  EXPORT spherecutTargets ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}")
install(EXPORT spherecutTargets NAMESPACE spherecut:: DESTINATION "${SPHERECUT_PACKAGE_FOLDER}")
install(TARGETS spherecut spherecut_live_program spherecut_experiment RUNTIME DESTINATION "${CMAKE_INSTALL_BINDIR}")
# Headers are installed under spherecut/ and say so when they include one another: a folder named src or topology on the
# include path of a program must not come before theirs.
install(CODE "set(source \"${PROJECT_SOURCE_DIR}\")
  cmake_path(ABSOLUTE_PATH CMAKE_INSTALL_PREFIX OUTPUT_VARIABLE prefix)
  set(target \"\$ENV{DESTDIR}\${prefix}/${CMAKE_INSTALL_INCLUDEDIR}/spherecut\")")
install(CODE [=[
  foreach(floor topology solvers src)
    file(GLOB_RECURSE headers RELATIVE "${source}" "${source}/${floor}/*.hpp")
    list(FILTER headers EXCLUDE REGEX "/node_modules/")
    foreach(header IN LISTS headers)
      file(READ "${source}/${header}" text)
      string(REGEX REPLACE "#include \"(topology|solvers|src)/" "#include \"spherecut/\\1/" text "${text}")
      file(WRITE "${target}/${header}" "${text}")
      list(APPEND CMAKE_INSTALL_MANIFEST_FILES "${target}/${header}")
    endforeach()
  endforeach()
]=])
install(DIRECTORY "${SPHERECUT_PAGE_FOLDER}/" DESTINATION "${CMAKE_INSTALL_DATADIR}/spherecut/page" OPTIONAL)
install(DIRECTORY scenarios DESTINATION "${CMAKE_INSTALL_DATADIR}/spherecut" FILES_MATCHING PATTERN "*.toml")
# Pages and examples lie to each other as they do here, so that links among them hold. The site where it is built
# (./dev docs).
install(FILES LICENSE README.md CHANGELOG.md CONTRIBUTING.md SECURITY.md CITATION.cff DESTINATION "${CMAKE_INSTALL_DOCDIR}")
install(DIRECTORY docs examples DESTINATION "${CMAKE_INSTALL_DOCDIR}"
  PATTERN site EXCLUDE PATTERN __pycache__ EXCLUDE)
install(DIRECTORY "${PROJECT_SOURCE_DIR}/build/docs/html" DESTINATION "${CMAKE_INSTALL_DOCDIR}" OPTIONAL)

configure_package_config_file(cmake/spherecutConfig.cmake.in "${PROJECT_BINARY_DIR}/spherecutConfig.cmake"
  INSTALL_DESTINATION "${SPHERECUT_PACKAGE_FOLDER}")
write_basic_package_version_file("${PROJECT_BINARY_DIR}/spherecutConfigVersion.cmake" COMPATIBILITY SameMinorVersion)
install(FILES "${PROJECT_BINARY_DIR}/spherecutConfig.cmake" "${PROJECT_BINARY_DIR}/spherecutConfigVersion.cmake"
  DESTINATION "${SPHERECUT_PACKAGE_FOLDER}")
