// Inside or outside of an organ, which a mesher asks some millions of times.
#pragma once

#include "topology/domain/domain.hpp"

#include <functional>
#include <memory>

namespace spherecut::experiments::ledger {

/// Tells the side as the domain's signed distance does, but asks it in cells of `cell` m near the surface alone: of the
/// others the side is found beforehand. Nothing outside the organ's box lies in it.
std::function<bool(const Vector3& x)> side_of_organ(std::shared_ptr<const topology::Domain> domain, double cell);

} // namespace spherecut::experiments::ledger
