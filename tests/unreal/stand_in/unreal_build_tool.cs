// The names of Unreal's build tool that the plugin's .Build.cs files use, and a program that runs them on a packed
// plugin.
using System;
using System.Collections.Generic;
using System.IO;

namespace UnrealBuildTool
{
    public class BuildException : Exception
    {
        public BuildException(string text) : base(text) { }
    }

    public class UnrealTargetPlatform
    {
        public static readonly UnrealTargetPlatform Win64 = new UnrealTargetPlatform("Win64");
        public static readonly UnrealTargetPlatform Linux = new UnrealTargetPlatform("Linux");
        private readonly string name;
        private UnrealTargetPlatform(string name) { this.name = name; }
        public override string ToString() { return name; }
    }

    public class ReadOnlyTargetRules
    {
        public UnrealTargetPlatform Platform;
    }

    public class ModuleRules
    {
        public enum PCHUsageMode { UseExplicitOrSharedPCHs }
        public static string Plugin;
        public string PluginDirectory { get { return Plugin; } }
        public PCHUsageMode PCHUsage;
        public List<string> PublicDependencyModuleNames = new List<string>();
        public List<string> PrivateDependencyModuleNames = new List<string>();
        public List<string> PublicSystemIncludePaths = new List<string>();
        public List<string> PublicAdditionalLibraries = new List<string>();
        public ModuleRules(ReadOnlyTargetRules target) { }
    }

    public static class Program
    {
        public static int Main(string[] arguments)
        {
            ModuleRules.Plugin = arguments[0];
            var target = new ReadOnlyTargetRules { Platform = UnrealTargetPlatform.Linux };
            var runtime = new DClothRuntime(target);
            if (!File.Exists(runtime.PublicAdditionalLibraries[0])) return 1;
            if (!File.Exists(Path.Combine(runtime.PublicSystemIncludePaths[0], "dcloth", "dcloth.h"))) return 1;
            if (!new DClothEditor(target).PrivateDependencyModuleNames.Contains("DClothRuntime")) return 1;
            try
            {
                target.Platform = UnrealTargetPlatform.Win64; // was not packed
                new DClothRuntime(target);
                return 1;
            }
            catch (BuildException e)
            {
                if (!e.Message.Contains("package_unreal.py Win64=LIBRARY")) return 1;
            }
            Console.WriteLine("build rules compiled and run");
            return 0;
        }
    }
}
