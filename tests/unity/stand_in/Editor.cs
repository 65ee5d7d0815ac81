// The import pipeline, which only records; see Objects.cs.
using System;
using System.Collections.Generic;
using Object = UnityEngine.Object;

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
