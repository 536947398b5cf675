#include "solvers/nodes.hpp"
