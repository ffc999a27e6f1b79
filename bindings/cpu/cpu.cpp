// SPDX-License-Identifier: Apache-2.0
/// Python module wavecomb._cpu, which reports the instruction sets of this CPU. The module is
/// compiled for the compiler's baseline, so that it runs on any CPU before a library for a specific
/// instruction set is loaded.
#include <Python.h>

#include <array>
#include <cstddef>

namespace {

/// Returns the names of the instruction sets in WAVECOMB_ISAS that this CPU and operating system
/// support, best first. Unused entries are null.
std::array<const char*, 4> runnable() {
  std::array<const char*, 4> names{};
  size_t count = 0;
#if defined(__x86_64__)
  __builtin_cpu_init();
  if (__builtin_cpu_supports("x86-64-v4")) names[count++] = "x86-64-v4";
  if (__builtin_cpu_supports("x86-64-v3")) names[count++] = "x86-64-v3";
  if (__builtin_cpu_supports("x86-64-v2")) names[count++] = "x86-64-v2";
#elif defined(__aarch64__)
  names[count++] = "armv8-a";  // every AArch64 CPU
#endif
  return names;
}

PyObject* isas(PyObject*, PyObject*) {
  PyObject* list = PyList_New(0);
  if (list == nullptr) return nullptr;
  for (const char* name : runnable()) {
    if (name == nullptr) break;
    PyObject* text = PyUnicode_FromString(name);
    const bool ok = text != nullptr && PyList_Append(list, text) == 0;
    Py_XDECREF(text);
    if (!ok) {
      Py_DECREF(list);
      return nullptr;
    }
  }
  return list;
}

PyMethodDef methods[] = {
    {"isas", isas, METH_NOARGS, "Returns the instruction sets that this CPU supports, best first."},
    {nullptr, nullptr, 0, nullptr}};

PyModuleDef module = {PyModuleDef_HEAD_INIT,
                      "_cpu",
                      "Instruction sets of this CPU.",
                      0,
                      methods,
                      nullptr,
                      nullptr,
                      nullptr,
                      nullptr};

}  // namespace

PyMODINIT_FUNC PyInit__cpu() {
  return PyModule_Create(&module);
}
