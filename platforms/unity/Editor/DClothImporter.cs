using System;
using System.IO;
using UnityEditor.AssetImporters;
using UnityEngine;

namespace DCloth.Editor
{
    /// <summary>Turns a .dcloth file of the project into a DClothAsset. A broken file is an error of the import, with
    /// the engine's words for what is wrong and where.</summary>
    [ScriptedImporter(1, "dcloth")]
    public sealed class DClothImporter : ScriptedImporter
    {
        public override void OnImportAsset(AssetImportContext context)
        {
            byte[] file = File.ReadAllBytes(context.assetPath);
            string fileName = Path.GetFileName(context.assetPath);
            var asset = ScriptableObject.CreateInstance<DClothAsset>();
            try
            {
                asset.SetFile(file, fileName, true);
            }
            catch (ClothException e)
            {
                UnityEngine.Object.DestroyImmediate(asset);
                context.LogImportError(e.Message);
                return;
            }
            catch (TypeLoadException e) // DllNotFoundException, EntryPointNotFoundException
            {
                asset.SetFile(file, fileName, false);
                context.LogImportWarning(fileName + " was imported unchecked: no native library for the editor, or " +
                                         "another version's; see the package's README, import again: " + e.Message);
            }
            context.AddObjectToAsset("garment", asset);
            context.SetMainObject(asset);
        }
    }
}
