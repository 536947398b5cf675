// Several functions as one, for std::visit: a case that is left out does not compile.
#pragma once

namespace spherecut::topology {

template <class... Visitors>
struct Overloaded : Visitors... {
  using Visitors::operator()...;
};
template <class... Visitors>
Overloaded(Visitors...) -> Overloaded<Visitors...>;

} // namespace spherecut::topology
