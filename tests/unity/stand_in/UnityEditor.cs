// The names and signatures of Unity's editor that the package uses; see Unity.cs.
using System;
using Object = UnityEngine.Object;

namespace UnityEditor
{
    [AttributeUsage(AttributeTargets.Method)]
    public sealed class MenuItem : Attribute
    {
        public MenuItem(string itemName, bool isValidateFunction, int priority) { }
    }

    public static class AssetDatabase
    {
        public static string[] FindAssets(string filter) => throw null;
        public static string GUIDToAssetPath(string guid) => throw null;
        public static T LoadAssetAtPath<T>(string assetPath) where T : Object => throw null;
    }

    public static class Selection
    {
        public static UnityEngine.GameObject activeGameObject { get; set; }
    }

    public static class Undo
    {
        public static void RegisterCreatedObjectUndo(Object objectToUndo, string name) => throw null;
        public static void RecordObject(Object objectToUndo, string name) => throw null;
    }
}

namespace UnityEditor.AssetImporters
{
    [AttributeUsage(AttributeTargets.Class)]
    public sealed class ScriptedImporterAttribute : Attribute
    {
        public ScriptedImporterAttribute(int version, string ext) { }
    }

    public abstract class ScriptedImporter : Object
    {
        public abstract void OnImportAsset(AssetImportContext ctx);
    }

    public class AssetImportContext
    {
        public string assetPath => throw null;
        public void AddObjectToAsset(string identifier, Object obj) => throw null;
        public void SetMainObject(Object obj) => throw null;
        public void LogImportError(string msg, Object obj = null) => throw null;
        public void LogImportWarning(string msg, Object obj = null) => throw null;
    }
}
