#pragma once
#include "solvers/galerkin/galerkin.hpp"
