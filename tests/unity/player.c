/* Runs a C# program inside this one, which has dcloth linked in: what "__Internal" means.
 * Arguments: PROGRAM.exe and its own. */
#include <mono/jit/jit.h>
#include <mono/metadata/assembly.h>
#include <mono/metadata/mono-config.h>
#include <stdio.h>

int main(int argc, char** argv) {
  MonoDomain* domain;
  MonoAssembly* assembly;
  int status;
  if (argc < 2) return 2;
  mono_config_parse(NULL);
  domain = mono_jit_init(argv[1]);
  assembly = mono_domain_assembly_open(domain, argv[1]);
  if (assembly == NULL) {
    fprintf(stderr, "%s: cannot be opened\n", argv[1]);
    return 2;
  }
  status = mono_jit_exec(domain, assembly, argc - 1, argv + 1);
  mono_jit_cleanup(domain);
  return status;
}
