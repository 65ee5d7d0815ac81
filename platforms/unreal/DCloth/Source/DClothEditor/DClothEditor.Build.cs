using UnrealBuildTool;

public class DClothEditor : ModuleRules
{
    public DClothEditor(ReadOnlyTargetRules Target) : base(Target)
    {
        PCHUsage = PCHUsageMode.UseExplicitOrSharedPCHs;
        PrivateDependencyModuleNames.AddRange(new string[] { "Core", "CoreUObject", "Engine", "UnrealEd",
            "DClothRuntime" });
    }
}
