#pragma once
#include "topology/base/errors.hpp"
