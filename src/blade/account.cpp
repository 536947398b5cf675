#include "src/blade/account.hpp"

#include <cmath>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

constexpr double least_share = 1e-3; // of the work, that is worth a word

} // namespace

std::array<AccountEntry, 6> account_of(const solvers::BladeLedger& ledger) {
  return {{{"work_J", "work", ledger.work},
           {"surface_J", "on new surface", ledger.surface},
           {"crushing_J", "crushed by the edge", ledger.crushing},
           {"friction_J", "friction of the flanks", ledger.friction},
           {"excess_J", "released beyond need", ledger.excess},
           {"stored_J", "stored in the tissue", ledger.stored}}};
}

std::string account_text(const solvers::BladeLedger& ledger) {
  std::string text = fmt::format("work {:.3g} mJ", 1e3 * ledger.work);
  const std::array<AccountEntry, 6> entries = account_of(ledger);
  const char* separator = ": ";
  for (auto entry = entries.begin() + 1; entry != entries.end(); ++entry)
    if (std::abs(entry->joules) >= least_share * std::abs(ledger.work)) {
      text += fmt::format("{}{:.3g} {}", separator, 1e3 * entry->joules, entry->what);
      separator = ", ";
    }
  return text;
}

} // namespace spherecut::app
