// Trees of processes, composed per realisation.
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "binding/arguments.h"
#include "binding/bindings.h"
#include "field/check.h"
#include "process/transformed.h"
#include "process/tree_surface.h"

namespace gpis {
namespace py = pybind11;
using namespace py::literals;
namespace {

TreePtr combined(ProcessTree::Kind kind, const py::args& operands, bool shared_noise,
                 const std::string& name, double blend = 0) {
  std::vector<TreePtr> parts;
  for (std::size_t i = 0; i < operands.size(); ++i)
    parts.push_back(tree_argument(operands[i], name + ": operand " + std::to_string(i)));
  return ProcessTree::combine(kind, parts, shared_noise, name, blend);
}

NumberArray composed(const ProcessTree& tree, const py::object& leaf_values) {
  const auto values = NumberArray::ensure(leaf_values);
  const auto leaves = static_cast<py::ssize_t>(tree.leaves().size());
  if (!values || values.ndim() < 1 || values.shape(values.ndim() - 1) != leaves) {
    PyErr_Clear();
    throw std::invalid_argument("values must be an array (…, " + std::to_string(leaves) +
                                "), the last axis over the leaves.");
  }
  NumberArray out(std::vector<py::ssize_t>(values.shape(), values.shape() + values.ndim() - 1));
  const double* row = values.data();
  std::vector<double> with_sign(leaves);
  for (py::ssize_t i = 0; i < out.size(); ++i, row += leaves) {
    for (py::ssize_t leaf = 0; leaf < leaves; ++leaf)
      with_sign[leaf] = tree.leaves()[leaf].sign * row[leaf];
    out.mutable_data()[i] = tree.compose(with_sign.data(), nullptr);
  }
  return out;
}

}  // namespace

void bind_tree(py::module_& m) {
  py::class_<ProcessTree, std::shared_ptr<ProcessTree>>(
      m, "ProcessTree",
      "A CSG tree of processes, composed per realisation: made by union, intersection, difference "
      "and complement, taken wherever\na GaussianProcess is (first_hits, the `process` of an "
      "object).")
      .def_property_readonly(
          "leaves",
          [](const ProcessTree& tree) {
            py::list out;
            for (const auto& leaf : tree.leaves())
              out.append(std::const_pointer_cast<GaussianProcess>(leaf.process));
            return out;
          },
          "The processes at the leaves, in the order of the operands: `part` and `materials` count "
          "them.")
      .def("compose", &composed, "values"_a,
           "F (…) from values (…, leaves) of the leaves: least for unions, greatest for "
           "intersections, complements negated, smooth unions blended.")
      .def(
          "plan",
          [](const std::shared_ptr<ProcessTree>& tree) {
            py::dict out;
            for (const auto& [key, text] :
                 TreeSurface(tree, {}, Memory::renewal_plus, Sampler::automatic, 1e-3).plan())
              out[py::str(key)] = text;
            return out;
          },
          "What a render of this tree chooses and leaves out.")
      .def(
          "transformed",
          [](const ProcessTree& tree, const NumberArray& matrix) {
            return std::const_pointer_cast<ProcessTree>(transformed(tree, affine_argument(matrix)));
          },
          "matrix"_a, "The tree moved by an affine matrix (4, 4), all its leaves with it.")
      .def("__repr__",
           [](const ProcessTree& tree) { return "<ProcessTree " + tree.describe() + ">"; });

  py::reinterpret_borrow<py::class_<GaussianProcess, std::shared_ptr<GaussianProcess>>>(
      m.attr("GaussianProcess"))
      .def(
          "transformed",
          [](const GaussianProcess& gp, const NumberArray& matrix) {
            return transformed(gp, affine_argument(matrix));
          },
          "matrix"_a,
          "The process moved by an affine matrix (4, 4): its f at x is that at matrix⁻¹ x, not "
          "rescaled; length scales are\nstretched and turned along. Bounds become the box around "
          "the moved ones. ValueError if the matrix is singular.");

  m.def(
      "union",
      [](const py::args& operands, bool shared_noise) {
        return std::const_pointer_cast<ProcessTree>(
            combined(ProcessTree::Kind::least, operands, shared_noise, "union"));
      },
      "shared_noise"_a = false,
      "Inside where any operand is: the least of their f. Operands are GaussianProcesses or "
      "trees.\nshared_noise: all leaves below see the same g; their kernels must be equal. "
      "Otherwise leaves are independent.");
  m.def(
      "smooth_union",
      [](const py::args& operands, double blend, bool shared_noise) {
        check_positive("smooth_union: blend", blend);
        return std::const_pointer_cast<ProcessTree>(
            combined(ProcessTree::Kind::least, operands, shared_noise, "smooth_union", blend));
      },
      "blend"_a, "shared_noise"_a = false,
      "A union whose crease is rounded where two operands are within `blend` of each other: "
      "min - max(0, blend - |a - b|)²/4blend, one\noperand after the other. "
      "f is not rescaled by transforms, and `blend` is in its units.");
  m.def(
      "intersection",
      [](const py::args& operands, bool shared_noise) {
        return std::const_pointer_cast<ProcessTree>(
            combined(ProcessTree::Kind::greatest, operands, shared_noise, "intersection"));
      },
      "shared_noise"_a = false, "Inside where all operands are: the greatest of their f.");
  m.def(
      "difference",
      [](const py::object& a, const py::object& b, bool shared_noise) {
        const TreePtr kept = tree_argument(a, "difference: a");
        const TreePtr removed = ProcessTree::complement(*tree_argument(b, "difference: b"));
        return std::const_pointer_cast<ProcessTree>(ProcessTree::combine(
            ProcessTree::Kind::greatest, {kept, removed}, shared_noise, "difference"));
      },
      "a"_a, "b"_a, py::kw_only(), "shared_noise"_a = false,
      "Inside where a is and b is not: max(a, -b).");
  m.def(
      "complement",
      [](const py::object& a) {
        return std::const_pointer_cast<ProcessTree>(
            ProcessTree::complement(*tree_argument(a, "complement: a")));
      },
      "a"_a, "Inside where a is not: -a.");
}

}  // namespace gpis
