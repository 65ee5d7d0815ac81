// The editor's assets, menus and import pipeline, which only record; see Objects.cs.
using System;
using System.Collections.Generic;
using System.Linq;
using Object = UnityEngine.Object;

namespace UnityEditor
{
    [AttributeUsage(AttributeTargets.Method)]
    public sealed class MenuItem : Attribute
    {
        public MenuItem(string itemName, bool isValidateFunction, int priority)
        {
        }
    }

    /// <summary>The assets that a test has put into its project; GUIDs are their names.</summary>
    public static class AssetDatabase
    {
        public static readonly List<Object> Project = new List<Object>();

        public static string[] FindAssets(string filter)
        {
            string[] parts = filter.Split(new[] { " t:" }, StringSplitOptions.None);
            return Project.Where(a => a.name.Contains(parts[0]) && a.GetType().Name == parts[1]).Select(a => a.name)
                .ToArray();
        }

        public static string GUIDToAssetPath(string guid)
        {
            return "Assets/" + guid;
        }

        public static T LoadAssetAtPath<T>(string assetPath) where T : Object
        {
            return Project.OfType<T>().FirstOrDefault(a => "Assets/" + a.name == assetPath);
        }
    }

    public static class Selection
    {
        public static UnityEngine.GameObject activeGameObject { get; set; }
    }

    public static class Undo
    {
        public static void RegisterCreatedObjectUndo(Object objectToUndo, string name)
        {
        }

        public static void RecordObject(Object objectToUndo, string name)
        {
        }
    }
}

namespace UnityEditor.AssetImporters
{
    [AttributeUsage(AttributeTargets.Class)]
    public sealed class ScriptedImporterAttribute : Attribute
    {
        public ScriptedImporterAttribute(int version, string ext)
        {
            Extension = ext;
        }

        public string Extension { get; }
    }

    public abstract class ScriptedImporter : Object
    {
        public abstract void OnImportAsset(AssetImportContext ctx);
    }

    public sealed class AssetImportContext
    {
        public readonly List<string> Errors = new List<string>(), Warnings = new List<string>();
        public readonly Dictionary<string, Object> Objects = new Dictionary<string, Object>();
        public Object Main;

        public AssetImportContext(string path)
        {
            assetPath = path;
        }

        public string assetPath { get; }

        public void AddObjectToAsset(string identifier, Object obj)
        {
            Objects.Add(identifier, obj);
        }

        public void SetMainObject(Object obj)
        {
            Main = obj;
        }

        public void LogImportError(string msg, Object obj = null)
        {
            Errors.Add(msg);
        }

        public void LogImportWarning(string msg, Object obj = null)
        {
            Warnings.Add(msg);
        }
    }
}
