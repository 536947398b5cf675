// All models, in the order of LawSpec::law.
#include "solvers/elasticity/deformation.inl"
#include "solvers/elasticity/spectrum.inl"

#include "solvers/elasticity/holzapfel.inl"
#include "solvers/elasticity/linear.inl"
#include "solvers/elasticity/neo_hookean.inl"
#include "solvers/elasticity/ogden.inl"
#include "solvers/elasticity/yeoh.inl"

/// The models as one list: kernels, laws and names are made from it.
template <class... Model>
struct ModelList {};
using Models = ModelList<LinearModel, NeoHookeanModel, YeohModel, OgdenModel, HolzapfelModel>;
