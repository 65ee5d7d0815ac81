// What Godot calls when it loads and unloads the extension.
#include <gdextension_interface.h>

#include <godot_cpp/classes/resource_loader.hpp>
#include <godot_cpp/core/class_db.hpp>
#include <godot_cpp/core/defs.hpp>
#include <godot_cpp/godot.hpp>

#include "dcloth_garment.h"
#include "dcloth_model.h"

using namespace godot;

namespace {

Ref<DClothModelLoader> loader;

void Initialize(ModuleInitializationLevel level) {
  if (level != MODULE_INITIALIZATION_LEVEL_SCENE) return;
  GDREGISTER_CLASS(DClothModel);
  GDREGISTER_CLASS(DClothModelLoader);
  GDREGISTER_CLASS(DClothGarment);
  loader.instantiate();
  ResourceLoader::get_singleton()->add_resource_format_loader(loader);
}

void Terminate(ModuleInitializationLevel level) {
  if (level != MODULE_INITIALIZATION_LEVEL_SCENE) return;
  ResourceLoader::get_singleton()->remove_resource_format_loader(loader);
  loader.unref();
}

}  // namespace

extern "C" GDExtensionBool GDE_EXPORT dcloth_library_init(GDExtensionInterfaceGetProcAddress get_proc_address,
                                                          GDExtensionClassLibraryPtr library,
                                                          GDExtensionInitialization* initialization) {
  GDExtensionBinding::InitObject init(get_proc_address, library, initialization);
  init.register_initializer(Initialize);
  init.register_terminator(Terminate);
  init.set_minimum_library_initialization_level(MODULE_INITIALIZATION_LEVEL_SCENE);
  return init.init();
}
