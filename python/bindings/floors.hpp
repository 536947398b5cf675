// The parts of the module: each adds the classes and functions of a floor or a concept. They are called in this order,
// because a signature may only name what is known already.
#pragma once

#include <pybind11/pybind11.h>

namespace spherecut::bindings {

void bind_errors(pybind11::module_& module);
void bind_surface(pybind11::module_& module);
void bind_domain(pybind11::module_& module);
void bind_tool(pybind11::module_& module);
void bind_incision(pybind11::module_& module);
void bind_wound(pybind11::module_& module);
void bind_nodes(pybind11::module_& module);
void bind_body(pybind11::module_& module);
void bind_law(pybind11::module_& module);
void bind_finite(pybind11::module_& module);
void bind_contact(pybind11::module_& module);
void bind_fracture(pybind11::module_& module);
void bind_session(pybind11::module_& module);

} // namespace spherecut::bindings
