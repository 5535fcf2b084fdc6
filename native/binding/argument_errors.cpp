#include "binding/argument_errors.h"

#include <algorithm>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "binding/reader.h"

namespace gpis {
namespace {

using Record = py::detail::function_record;
using Dispatcher = PyObject* (*)(PyObject*, PyObject* const*, Py_ssize_t, PyObject*);

// Types as pybind11 writes them into signatures.
constexpr std::string_view kNumber = "typing.SupportsFloat | typing.SupportsIndex";
constexpr std::string_view kInteger = "typing.SupportsInt | typing.SupportsIndex";
constexpr std::string_view kOrNone = " | None", kSequence = "collections.abc.Sequence[",
                           kAnnotated = "typing.Annotated[", kArray = "numpy.typing.ArrayLike, ",
                           kModule = "gpis_native.";

struct Parameter {
  std::string name, type;  // type: as pybind11 writes it into the signature
  bool has_default = false, keyword_only = false;
};

// The text up to `separator`, which it takes off the front of `rest` too; brackets and quotation
// marks hold what is inside them together.
std::string_view take_until(std::string_view& rest, std::string_view separator) {
  int depth = 0;
  char quote = 0;
  for (std::size_t i = 0; i < rest.size(); ++i) {
    const char c = rest[i];
    if (quote) {
      if (c == quote) quote = 0;
      continue;
    }
    if (depth == 0 && rest.substr(i).starts_with(separator)) {
      const std::string_view taken = rest.substr(0, i);
      rest.remove_prefix(i + separator.size());
      return taken;
    }
    if (c == '\'' || c == '"') quote = c;
    if (c == '(' || c == '[' || c == '{' || c == '<') ++depth;
    if (c == ')' || c == ']' || c == '}' || c == '>') --depth;
  }
  const std::string_view taken = rest;
  rest = {};
  return taken;
}

// "(self: gpis_native.Film, x: typing.SupportsInt | typing.SupportsIndex, ...) -> None"
std::vector<Parameter> parameters_of(const Record& record) {
  std::string_view rest = record.signature;
  rest.remove_prefix(1);
  std::string_view list = take_until(rest, ")");
  std::vector<Parameter> parameters;
  bool keyword_only = false;
  while (!list.empty()) {
    std::string_view piece = take_until(list, ", ");
    if (piece == "*" || piece == "/") {
      keyword_only |= piece == "*";
      continue;
    }
    Parameter p;
    p.name = take_until(piece, ": ");
    p.type = take_until(piece, " = ");
    p.has_default = !piece.empty();
    p.keyword_only = keyword_only;
    parameters.push_back(p);
  }
  return parameters;
}

bool strip_prefix(std::string_view& text, std::string_view prefix) {
  if (!text.starts_with(prefix)) return false;
  text.remove_prefix(prefix.size());
  return true;
}
bool strip_suffix(std::string_view& text, std::string_view suffix) {
  if (!text.ends_with(suffix)) return false;
  text.remove_suffix(suffix.size());
  return true;
}

// The type of a parameter, in words and as a test.
struct Wanted {
  std::string words, plural;
  // Whether the value is of the kind. An integer may still not fit into C++'s type.
  std::function<bool(py::handle)> fits;
};

Wanted wanted(std::string_view type) {
  if (strip_suffix(type, kOrNone)) {
    Wanted other = wanted(type);
    return {other.words + " or None", other.plural,
            [fits = other.fits](py::handle v) { return v.is_none() || fits(v); }};
  }
  if (type == kNumber || type == "float")
    return {"a number", "numbers", [](py::handle v) {
              const auto number = py::reinterpret_steal<py::object>(
                  PyNumber_Check(v.ptr()) ? PyNumber_Float(v.ptr()) : nullptr);
              PyErr_Clear();
              return static_cast<bool>(number);
            }};
  if (type == kInteger || type == "int")
    return {"an integer", "integers",
            [](py::handle v) { return PyIndex_Check(v.ptr()) && !py::isinstance<py::array>(v); }};
  if (type == "str")
    return {"a text", "texts", [](py::handle v) { return py::isinstance<py::str>(v); }};
  if (type == "bool")
    return {"True or False", "truth values",
            [](py::handle v) { return py::isinstance<py::bool_>(v); }};
  if (type == "object") return {"a value", "values", [](py::handle) { return true; }};
  if (type == "dict")
    return {"a dict", "dicts", [](py::handle v) { return py::isinstance<py::dict>(v); }};
  if (type == "list")
    return {"a list", "lists", [](py::handle v) { return py::isinstance<py::list>(v); }};
  if (std::string_view inner = type;
      strip_prefix(inner, kAnnotated) && strip_prefix(inner, kArray)) {
    return {"an array of numbers", "arrays of numbers", [](py::handle v) {
              const bool numeric = static_cast<bool>(DoubleArray::ensure(v));
              PyErr_Clear();
              return numeric;
            }};
  }
  if (std::string_view inner = type; strip_prefix(inner, kAnnotated)) {
    const std::string_view sequence = take_until(inner, ", ");
    if (strip_prefix(inner, "\"FixedSize(") && strip_suffix(inner, ")\"]")) {
      const Wanted all = wanted(sequence);
      const std::size_t count = std::stoul(std::string(inner));
      return {std::string(inner) + " " + all.plural, "lists of " + all.plural,
              [all, count](py::handle v) { return all.fits(v) && py::len(v) == count; }};
    }
  }
  if (std::string_view inner = type; strip_prefix(inner, kSequence) && strip_suffix(inner, "]")) {
    const Wanted each = wanted(inner);
    return {"a list of " + each.plural, each.plural, [each](py::handle v) {
              if (!py::isinstance<py::sequence>(v) || py::isinstance<py::str>(v) ||
                  py::isinstance<py::bytes>(v))
                return false;
              const auto items = py::reinterpret_borrow<py::sequence>(v);
              return std::all_of(items.begin(), items.end(), each.fits);
            }};
  }
  if (std::string_view name = type; strip_prefix(name, kModule)) {
    const bool vowel = std::string_view("AEIOU").find(name[0]) != std::string_view::npos;
    const py::object type_object =
        py::module_::import("gpis_native").attr(std::string(name).c_str());
    return {(vowel ? "an " : "a ") + std::string(name), std::string(name) + "s",
            [type_object](py::handle v) { return py::isinstance(v, type_object); }};
  }
  return {std::string(type), std::string(type), [](py::handle) { return true; }};
}

// Arguments of a call beside the parameters they are meant for.
struct Call {
  PyObject* const* arguments;
  std::size_t positional;
  PyObject* keywords;  // names of the arguments after the positional ones; may be null

  std::size_t keyword_count() const { return keywords ? PyTuple_GET_SIZE(keywords) : 0; }
  std::string keyword(std::size_t i) const {
    return py::cast<std::string>(py::handle(PyTuple_GET_ITEM(keywords, i)));
  }
  py::handle find(const std::string& name) const {
    for (std::size_t i = 0; i < keyword_count(); ++i)
      if (keyword(i) == name) return arguments[positional + i];
    return {};
  }
};

std::string names_of(const std::vector<Parameter>& parameters) {
  std::string names;
  for (const Parameter& p : parameters) names += (names.empty() ? "" : ", ") + p.name;
  return names.empty() ? "none" : names;
}

// What is wrong with the arguments, which pybind11 has refused.
std::string explain(const Record& record, Call call) {
  std::vector<Parameter> parameters = parameters_of(record);
  if (record.is_method && !parameters.empty() && call.positional > 0) {
    if (const Wanted self = wanted(parameters[0].type); !self.fits(call.arguments[0]))
      return "self takes " + self.words + ", got " + shown(call.arguments[0]);
    parameters.erase(parameters.begin());
    ++call.arguments;
    --call.positional;
  }
  for (std::size_t i = 0; i < call.keyword_count(); ++i)
    if (std::none_of(parameters.begin(), parameters.end(),
                     [&](const Parameter& p) { return p.name == call.keyword(i); }))
      return "there is no argument '" + call.keyword(i) + "'; it takes " + names_of(parameters);
  const std::size_t most = std::count_if(parameters.begin(), parameters.end(),
                                         [](const Parameter& p) { return !p.keyword_only; });
  if (call.positional > most)
    return std::to_string(call.positional) + " arguments without a name are given; it takes " +
           std::to_string(most) + " of these, and in all " + names_of(parameters);
  std::vector<std::pair<const Parameter*, py::handle>> given;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const Parameter& p = parameters[i];
    const py::handle by_name = call.find(p.name);
    if (i < call.positional && by_name) return p.name + " is given twice";
    const py::handle value = i < call.positional ? py::handle(call.arguments[i]) : by_name;
    if (value)
      given.emplace_back(&p, value);
    else if (!p.has_default)
      return p.name + " is missing; it takes " + wanted(p.type).words;
  }
  for (const auto& [p, value] : given)
    if (!wanted(p->type).fits(value))
      return p->name + " takes " + wanted(p->type).words + ", got " + shown(value);
  // All are of the right kind, so it is an integer that C++'s type cannot hold.
  std::string sentence;
  for (const auto& [p, value] : given) {
    if (!p->type.starts_with(kInteger) || value.is_none()) continue;
    const auto number = py::reinterpret_steal<py::object>(PyNumber_Index(value.ptr()));
    if (number < py::int_(0) || number > py::int_(INT32_MAX))
      sentence += (sentence.empty() ? "" : ", or ") + p->name + " takes " +
                  (number < py::int_(0) ? "an integer that is not negative" : "a smaller integer") +
                  ", got " + shown(value);
  }
  return sentence.empty() ? "takes " + std::string(record.signature) : sentence;
}

Dispatcher pybind_dispatcher = nullptr;

// pybind11's dispatcher, with its TypeError put into words. A TypeError of Python code that the
// function has called passes.
PyObject* dispatch(PyObject* self, PyObject* const* arguments, Py_ssize_t positional,
                   PyObject* keywords) {
  PyObject* const result = pybind_dispatcher(self, arguments, positional, keywords);
  if (result || !PyErr_ExceptionMatches(PyExc_TypeError)) return result;
  const Record& record = *py::detail::function_record_ptr_from_PyObject(self);
  py::error_already_set error;
  const std::string message = py::str(error.value());
  if (!message.starts_with(std::string(record.name) + "(): incompatible ")) {
    error.restore();
    return nullptr;
  }
  try {
    const std::string name =
        record.is_constructor ? py::cast<std::string>(record.scope.attr("__name__")) : record.name;
    const Call call{arguments, static_cast<std::size_t>(PyVectorcall_NARGS(positional)), keywords};
    PyErr_SetString(PyExc_ValueError, (name + ": " + explain(record, call) + ".").c_str());
  } catch (py::error_already_set& e) {
    e.restore();
  }
  return nullptr;
}

void wrap(py::handle function) {
  if (PyInstanceMethod_Check(function.ptr()))
    function = PyInstanceMethod_GET_FUNCTION(function.ptr());
  if (!PyCFunction_Check(function.ptr())) return;
  PyObject* const self = PyCFunction_GET_SELF(function.ptr());
  if (!self || !py::detail::is_function_record_PyObject(self)) return;
  PyCFunction& method = reinterpret_cast<PyCFunctionObject*>(function.ptr())->m_ml->ml_meth;
  const auto own = reinterpret_cast<PyCFunction>(reinterpret_cast<void (*)()>(&dispatch));
  if (method == own) return;  // under a second name
  pybind_dispatcher = reinterpret_cast<Dispatcher>(reinterpret_cast<void (*)()>(method));
  method = own;
}

}  // namespace

void explain_wrong_arguments(const py::module_& m) {
  for (const auto& [name, value] : py::reinterpret_borrow<py::dict>(m.attr("__dict__"))) {
    wrap(value);
    if (PyType_Check(value.ptr()))
      for (const auto& item : py::dict(value.attr("__dict__"))) wrap(item.second);
  }
}

}  // namespace gpis
