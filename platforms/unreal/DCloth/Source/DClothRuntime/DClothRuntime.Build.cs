using System.IO;
using UnrealBuildTool;

public class DClothRuntime : ModuleRules
{
    public DClothRuntime(ReadOnlyTargetRules Target) : base(Target)
    {
        PCHUsage = PCHUsageMode.UseExplicitOrSharedPCHs;
        PublicDependencyModuleNames.AddRange(
            new string[] { "Core", "CoreUObject", "Engine", "ProceduralMeshComponent" });
        PrivateDependencyModuleNames.AddRange(new string[] { "RenderCore", "RHI" });

        // scripts/package_unreal.py puts headers, the shared core and a static library for each platform there.
        string folder = Path.Combine(PluginDirectory, "Source", "ThirdParty", "dcloth");
        string name = Target.Platform == UnrealTargetPlatform.Win64 ? "dcloth.lib" : "libdcloth.a";
        string library = Path.Combine(folder, "lib", Target.Platform.ToString(), name);
        if (!File.Exists(library))
        {
            throw new BuildException("dcloth: found no library at " + library +
                                     "; pack the plugin with scripts/package_unreal.py " + Target.Platform +
                                     "=LIBRARY");
        }
        PublicSystemIncludePaths.Add(Path.Combine(folder, "include"));
        PublicAdditionalLibraries.Add(library);
    }
}
