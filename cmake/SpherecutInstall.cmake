# Installation and the package that find_package(spherecut) reads.
