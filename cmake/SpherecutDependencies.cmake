# Third-party packages, all from Debian 12. Only Eigen appears in public headers.
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(CGAL 5.5 REQUIRED)
include(CGAL_Eigen3_support)
list(APPEND CMAKE_MODULE_PATH "/usr/lib/${CMAKE_LIBRARY_ARCHITECTURE}/cmake/OpenVDB")
find_package(OpenVDB 10 REQUIRED COMPONENTS openvdb)
find_package(TBB REQUIRED)
find_package(ZLIB REQUIRED)
find_package(fcl 0.7 REQUIRED)
find_package(Threads REQUIRED)
find_package(CLI11 REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(tomlplusplus REQUIRED)
find_package(fmt REQUIRED)
find_package(Boost 1.74 REQUIRED) # Beast and Asio: headers
find_package(BLAS REQUIRED)
find_package(LAPACK REQUIRED)

# SuiteSparse 5.12 and voro++ ship no CMake configuration.
find_path(SPHERECUT_SUITESPARSE_INCLUDE umfpack.h PATH_SUFFIXES suitesparse REQUIRED)
add_library(spherecut_suitesparse INTERFACE)
target_include_directories(spherecut_suitesparse SYSTEM INTERFACE $<BUILD_INTERFACE:${SPHERECUT_SUITESPARSE_INCLUDE}>)
target_link_libraries(spherecut_suitesparse INTERFACE cholmod umfpack amd colamd camd ccolamd suitesparseconfig LAPACK::LAPACK BLAS::BLAS)

find_path(SPHERECUT_VORO_INCLUDE voro++.hh PATH_SUFFIXES voro++ REQUIRED)
find_library(SPHERECUT_VORO_LIBRARY voro++ REQUIRED)
add_library(spherecut_voro INTERFACE)
target_include_directories(spherecut_voro SYSTEM INTERFACE $<BUILD_INTERFACE:${SPHERECUT_VORO_INCLUDE}>)
target_link_libraries(spherecut_voro INTERFACE voro++)
