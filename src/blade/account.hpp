// Where a blade's work has gone, under the names that files and screen have for it.
#pragma once

#include "solvers/contact/blade_contact.hpp"

#include <array>
#include <string>

namespace spherecut::app {

struct AccountEntry {
  const char* key;  // in JSON, with its unit
  const char* what; // on a screen
  double joules;
};

/// The work first, then all that it went into.
std::array<AccountEntry, 6> account_of(const solvers::BladeLedger& ledger);

/// "work 2.78 mJ: 2.77 on new surface, 0.01 stored": entries of a thousandth of the work and more, in mJ.
std::string account_text(const solvers::BladeLedger& ledger);

} // namespace spherecut::app
