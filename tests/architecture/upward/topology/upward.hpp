#include "solvers/nodes/nodes.hpp"
