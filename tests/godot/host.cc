// Loads the compiled extension as Godot does, through the C interface: resolves its entry, initializes it, takes down
// what it registers, makes a garment, calls its methods, its notification and its virtual functions, and unloads it. Of
// Godot's own types it has strings, names and objects that do nothing; whatever else the extension calls ends the
// program with its name. Arguments: LIBRARY ENTRY.
#include <dlfcn.h>
#include <gdextension_interface.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace {

int faults = 0;

void Expect(bool good, const std::string& what) {
  if (good) return;
  ++faults;
  std::fprintf(stderr, "host: %s\n", what.c_str());
}

// Strings and names: eight bytes, the address of a text that stays; null for the empty one.
const std::string* Intern(const std::string& text) {
  static std::set<std::string> texts;
  return text.empty() ? nullptr : &*texts.insert(text).first;
}
std::string TextOf(const void* name) {
  const std::string* text = nullptr;
  std::memcpy(&text, name, sizeof(text));
  return text == nullptr ? "" : *text;
}
void PutText(void* to, const char* text) {
  const std::string* const interned = Intern(text);
  std::memcpy(to, &interned, sizeof(interned));
}

struct Object {
  std::string type;
  void* instance = nullptr;  // the extension's
  void* binding = nullptr;
  int references = 0;
};

struct Method {
  GDExtensionClassMethodPtrCall call;
  void* userdata;
  uint32_t arguments;
};
struct Class {
  std::string parent;
  GDExtensionClassCreationInfo3 info;
  std::map<std::string, Method> methods;
  std::map<std::string, std::pair<std::string, std::string>> properties;  // setter, getter
  std::set<std::string> constants;
};
std::map<std::string, Class> classes;
std::set<std::string> unregistered;
std::vector<std::string> calls;  // of the engine's own methods

// A function for each name of the interface that nothing below gives a meaning to.
constexpr size_t kStubs = 1024;
std::array<std::string, kStubs> stub_names;
template <size_t kIndex>
void Stub() {
  std::fprintf(stderr, "host: the extension called %s, which this host lacks\n", stub_names[kIndex].c_str());
  std::exit(1);
}
template <size_t... kIndex>
constexpr std::array<void (*)(), kStubs> MakeStubs(std::index_sequence<kIndex...>) {
  return {Stub<kIndex>...};
}
GDExtensionInterfaceFunctionPtr StubFor(const std::string& name) {
  static constexpr auto kAll = MakeStubs(std::make_index_sequence<kStubs>());
  static size_t used = 0;
  for (size_t i = 0; i < used; ++i) {
    if (stub_names[i] == name) return kAll[i];
  }
  if (used == kStubs) return nullptr;
  stub_names[used] = name;
  return kAll[used++];
}

bool IsWide(GDExtensionVariantType type) {  // sixteen bytes; the other types that a registration makes have eight
  return type == GDEXTENSION_VARIANT_TYPE_CALLABLE || type == GDEXTENSION_VARIANT_TYPE_SIGNAL ||
         type >= GDEXTENSION_VARIANT_TYPE_PACKED_BYTE_ARRAY;
}
template <size_t kBytes>
void Clear(GDExtensionUninitializedTypePtr to, const GDExtensionConstTypePtr*) {
  std::memset(to, 0, kBytes);
}
template <size_t kBytes>
void Copy(GDExtensionUninitializedTypePtr to, const GDExtensionConstTypePtr* from) {
  std::memcpy(to, from[0], kBytes);
}
GDExtensionPtrConstructor ConstructorOf(GDExtensionVariantType type, int32_t index) {
  if (IsWide(type)) return index == 0 ? Clear<16> : Copy<16>;
  return index == 0 ? Clear<8> : Copy<8>;
}
GDExtensionPtrDestructor DestructorOf(GDExtensionVariantType) {
  return [](GDExtensionTypePtr) {};
}
GDExtensionPtrOperatorEvaluator OperatorOf(GDExtensionVariantOperator operation, GDExtensionVariantType,
                                           GDExtensionVariantType) {
  if (operation == GDEXTENSION_VARIANT_OP_EQUAL) {
    return [](GDExtensionConstTypePtr a, GDExtensionConstTypePtr b, GDExtensionTypePtr to) {
      *static_cast<bool*>(to) = std::memcmp(a, b, 8) == 0;
    };
  }
  if (operation == GDEXTENSION_VARIANT_OP_NOT_EQUAL) {
    return [](GDExtensionConstTypePtr a, GDExtensionConstTypePtr b, GDExtensionTypePtr to) {
      *static_cast<bool*>(to) = std::memcmp(a, b, 8) != 0;
    };
  }
  return reinterpret_cast<GDExtensionPtrOperatorEvaluator>(StubFor("an operator"));
}
// Methods of strings and of arrays of strings that name an enumeration: an array is the address of its texts, which
// stay.
using Texts = std::vector<std::string>;
void Hash(GDExtensionTypePtr of, const GDExtensionConstTypePtr*, GDExtensionTypePtr to, int) { std::memcpy(to, of, 8); }
void Split(GDExtensionTypePtr of, const GDExtensionConstTypePtr* arguments, GDExtensionTypePtr to, int) {
  auto* const parts = new Texts;
  const std::string text = TextOf(of), at = TextOf(arguments[0]);
  size_t begin = 0;
  for (size_t end = 0; (end = text.find(at, begin)) != std::string::npos; begin = end + at.size()) {
    parts->push_back(text.substr(begin, end - begin));
  }
  parts->push_back(text.substr(begin));
  std::memcpy(to, &parts, sizeof(parts));
}
void Join(GDExtensionTypePtr of, const GDExtensionConstTypePtr* arguments, GDExtensionTypePtr to, int) {
  std::string joined;
  for (const std::string& part : **static_cast<Texts* const*>(arguments[0])) {
    joined += (joined.empty() ? "" : TextOf(of)) + part;
  }
  PutText(to, joined.c_str());
}
void Size(GDExtensionTypePtr of, const GDExtensionConstTypePtr*, GDExtensionTypePtr to, int) {
  const Texts* const texts = *static_cast<Texts* const*>(of);
  *static_cast<int64_t*>(to) = texts == nullptr ? 0 : static_cast<int64_t>(texts->size());
}
GDExtensionPtrBuiltInMethod BuiltInOf(GDExtensionVariantType type, GDExtensionConstStringNamePtr name, GDExtensionInt) {
  const std::string text = TextOf(name);
  const bool string = type == GDEXTENSION_VARIANT_TYPE_STRING || type == GDEXTENSION_VARIANT_TYPE_STRING_NAME;
  if (string && text == "hash") return Hash;
  if (string && text == "split") return Split;
  if (string && text == "join") return Join;
  if (type == GDEXTENSION_VARIANT_TYPE_PACKED_STRING_ARRAY && text == "size") return Size;
  return reinterpret_cast<GDExtensionPtrBuiltInMethod>(StubFor("the built-in method " + text));
}

// The engine's methods, by name. References are counted; the rest is written down and gives zeros.
void CallMethod(GDExtensionMethodBindPtr bind, GDExtensionObjectPtr object, const GDExtensionConstTypePtr*,
                GDExtensionTypePtr to) {
  const std::string& name = *static_cast<const std::string*>(bind);
  auto* const self = static_cast<Object*>(object);
  if (name == "init_ref" || name == "reference") {
    self->references += 1;
    *static_cast<int8_t*>(to) = 1;
  } else if (name == "unreference") {
    *static_cast<int8_t*>(to) = --self->references == 0;
  } else {
    calls.push_back(name);
    if (to != nullptr) std::memset(to, 0, 8);
  }
}

template <typename F>
GDExtensionInterfaceFunctionPtr As(F* function) {
  return reinterpret_cast<GDExtensionInterfaceFunctionPtr>(function);
}

GDExtensionInterfaceFunctionPtr GetProcAddress(const char* symbol) {
  static const std::map<std::string, GDExtensionInterfaceFunctionPtr> known = {
      {"get_godot_version", As(+[](GDExtensionGodotVersion* v) {
         *v = {4, 3, 0, "4.3"};
       })},
      {"mem_alloc", As(+[](size_t bytes) { return std::malloc(bytes); })},
      {"mem_realloc", As(+[](void* old, size_t bytes) { return std::realloc(old, bytes); })},
      {"mem_free", As(+[](void* old) { std::free(old); })},
      {"print_error", As(+[](const char* text, const char*, const char*, int32_t, GDExtensionBool) {
         Expect(false, std::string("the extension printed: ") + text);
       })},
      {"print_error_with_message",
       As(+[](const char*, const char* text, const char*, const char*, int32_t, GDExtensionBool) {
         Expect(false, std::string("the extension printed: ") + text);
       })},
      {"string_name_new_with_latin1_chars",
       As(+[](void* to, const char* text, GDExtensionBool) { PutText(to, text); })},
      {"string_name_new_with_utf8_chars", As(+[](void* to, const char* text) { PutText(to, text); })},
      {"string_new_with_latin1_chars", As(+[](void* to, const char* text) { PutText(to, text); })},
      {"string_new_with_utf32_chars", As(+[](void* to, const char32_t* text) {
         std::string narrow;
         for (; *text != 0; ++text) narrow.push_back(static_cast<char>(*text));
         PutText(to, narrow.c_str());
       })},
      {"string_new_with_utf8_chars", As(+[](void* to, const char* text) { PutText(to, text); })},
      {"variant_get_ptr_constructor", As(ConstructorOf)},
      {"variant_get_ptr_destructor", As(DestructorOf)},
      {"variant_get_ptr_operator_evaluator", As(OperatorOf)},
      {"variant_get_ptr_builtin_method", As(BuiltInOf)},
      {"variant_new_nil", As(+[](void* to) { std::memset(to, 0, 24); })},
      {"variant_destroy", As(+[](void*) {})},
      {"global_get_singleton", As(+[](const void* name) -> void* {
         static std::map<std::string, Object> singletons;
         Object& one = singletons[TextOf(name)];
         one.type = TextOf(name);
         return &one;
       })},
      {"classdb_construct_object", As(+[](const void* name) -> void* { return new Object{TextOf(name)}; })},
      {"object_set_instance",
       As(+[](void* object, const void*, void* instance) { static_cast<Object*>(object)->instance = instance; })},
      {"object_set_instance_binding",
       As(+[](void* object, void*, void* binding, const void*) { static_cast<Object*>(object)->binding = binding; })},
      {"object_get_instance_binding",
       As(+[](void* object, void* token, const GDExtensionInstanceBindingCallbacks* callbacks) {
         auto* const self = static_cast<Object*>(object);
         if (self->binding == nullptr) self->binding = callbacks->create_callback(token, object);
         return self->binding;
       })},
      {"object_free_instance_binding",
       As(+[](void* object, void*) { static_cast<Object*>(object)->binding = nullptr; })},
      {"object_destroy", As(+[](void* object) { delete static_cast<Object*>(object); })},
      {"classdb_get_method_bind", As(+[](const void*, const void* name, GDExtensionInt) {
         return static_cast<const void*>(Intern(TextOf(name)));
       })},
      {"object_method_bind_ptrcall", As(CallMethod)},
      {"classdb_register_extension_class3",
       As(+[](void*, const void* name, const void* parent, const GDExtensionClassCreationInfo3* info) {
         classes[TextOf(name)] = {TextOf(parent), *info, {}, {}, {}};
       })},
      {"classdb_register_extension_class_method",
       As(+[](void*, const void* name, const GDExtensionClassMethodInfo* info) {
         classes[TextOf(name)].methods[TextOf(info->name)] = {info->ptrcall_func, info->method_userdata,
                                                              info->argument_count};
       })},
      {"classdb_register_extension_class_property_indexed",
       As(+[](void*, const void* name, const GDExtensionPropertyInfo* info, const void* setter, const void* getter,
              GDExtensionInt) {
         classes[TextOf(name)].properties[TextOf(info->name)] = {TextOf(setter), TextOf(getter)};
       })},
      {"classdb_register_extension_class_integer_constant",
       As(+[](void*, const void* name, const void*, const void* constant, GDExtensionInt, GDExtensionBool) {
         classes[TextOf(name)].constants.insert(TextOf(constant));
       })},
      {"classdb_unregister_extension_class", As(+[](void*, const void* name) { unregistered.insert(TextOf(name)); })},
  };
  // What hands out functions hands out stubs.
  static const std::set<std::string> givers = {
      "variant_get_ptr_utility_function", "variant_get_ptr_setter",         "variant_get_ptr_getter",
      "variant_get_ptr_indexed_setter",   "variant_get_ptr_indexed_getter", "variant_get_ptr_keyed_setter",
      "variant_get_ptr_keyed_getter",     "variant_get_ptr_keyed_checker",  "get_variant_from_type_constructor",
      "get_variant_to_type_constructor",  "variant_get_ptr_internal_getter"};
  const auto found = known.find(symbol);
  if (found != known.end()) return found->second;
  if (givers.count(symbol) == 0) return StubFor(symbol);
  return As(+[](const void*, const void*, int64_t) { return StubFor("a function of a built-in type"); });
}

// A property of the garment that keeps what it is given.
template <typename T, size_t kCount>
void RoundTrip(const Class& type, void* instance, const std::string& property, const std::array<T, kCount>& value) {
  const auto accessors = type.properties.find(property);
  if (accessors == type.properties.end()) return Expect(false, "no property " + property);
  const auto setter = type.methods.find(accessors->second.first), getter = type.methods.find(accessors->second.second);
  if (setter == type.methods.end() || getter == type.methods.end()) return Expect(false, property + " lacks a method");
  const GDExtensionConstTypePtr arguments[] = {value.data()};
  std::array<T, kCount> found = {};
  setter->second.call(setter->second.userdata, instance, arguments, nullptr);
  getter->second.call(getter->second.userdata, instance, nullptr, found.data());
  Expect(found == value, property + " does not keep its value");
}

void TryGarment() {
  const Class& type = classes["DClothGarment"];
  Expect(type.parent == "MeshInstance3D", "DClothGarment is a " + type.parent);
  Expect(type.properties.size() == 10 && type.constants.size() == 6, "properties or constants of DClothGarment");
  for (const auto& [name, accessors] : type.properties) {
    Expect(type.methods.count(accessors.first) == 1 && type.methods.at(accessors.first).arguments == 1,
           "setter of " + name);
    Expect(type.methods.count(accessors.second) == 1 && type.methods.at(accessors.second).arguments == 0,
           "getter of " + name);
  }
  calls.clear();
  auto* const object = static_cast<Object*>(type.info.create_instance_func(type.info.class_userdata));
  const auto called = [](const char* name) {
    for (const std::string& call : calls) {
      if (call == name) return true;
    }
    return false;
  };
  Expect(object != nullptr && object->instance != nullptr, "DClothGarment cannot be made");
  Expect(called("set_as_top_level") && called("set_process_priority"), "DClothGarment is not prepared");
  RoundTrip<float, 3>(type, object->instance, "wind", {1, -2, 3.5f});
  RoundTrip<int64_t, 1>(type, object->instance, "detail", {1});
  RoundTrip<int64_t, 1>(type, object->instance, "fit", {2});
  RoundTrip<int8_t, 1>(type, object->instance, "pipelined", {1});
  RoundTrip<int8_t, 1>(type, object->instance, "outside_body", {0});
  constexpr int32_t kReady = 13;
  type.info.notification_func(object->instance, kReady, 0);
  Expect(called("is_editor_hint") && called("set_process_internal"), "DClothGarment does not start");
  type.info.free_instance_func(type.info.class_userdata, object->instance);
  delete object;
}

void TryLoader() {
  const Class& type = classes["DClothModelLoader"];
  Expect(type.parent == "ResourceFormatLoader", "DClothModelLoader is a " + type.parent);
  for (const char* name : {"_load", "_handles_type", "_get_resource_type", "_get_recognized_extensions", "_exists"}) {
    const std::string* const text = Intern(name);
    const bool has = type.info.get_virtual_func(type.info.class_userdata, &text) != nullptr;
    Expect(has == (std::strcmp(name, "_exists") != 0), std::string("the loader's ") + name);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  void* const library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) return std::fprintf(stderr, "host: %s\n", dlerror()), 1;
  const auto entry = reinterpret_cast<GDExtensionInitializationFunction>(dlsym(library, argv[2]));
  if (entry == nullptr) return std::fprintf(stderr, "host: no entry %s\n", argv[2]), 1;
  GDExtensionInitialization extension = {};
  int token = 0;
  Expect(entry(GetProcAddress, &token, &extension) != 0, "the entry refused");
  Expect(extension.minimum_initialization_level == GDEXTENSION_INITIALIZATION_SCENE, "another level than the scene's");
  if (faults != 0) return 1;
  extension.initialize(extension.userdata, GDEXTENSION_INITIALIZATION_SCENE);
  Expect(classes.size() == 3 && classes.count("DClothModel") == 1, "classes are missing");
  Expect(!calls.empty() && calls.back() == "add_resource_format_loader", "the loader is not added");
  size_t methods = 0;
  for (const auto& [name, type] : classes) methods += type.methods.size();
  TryGarment();
  TryLoader();
  calls.clear();
  extension.deinitialize(extension.userdata, GDEXTENSION_INITIALIZATION_SCENE);
  Expect(calls == std::vector<std::string>{"remove_resource_format_loader"}, "the loader is not removed");
  Expect(unregistered.size() == classes.size(), "classes are not taken back");
  std::printf("%zu classes, %zu methods, %zu properties registered; %d faults\n", classes.size(), methods,
              classes["DClothGarment"].properties.size(), faults);
  return faults == 0 ? 0 : 1;
}
