using System.Linq;
using UnityEditor;
using UnityEngine;

namespace DCloth.Samples.Editor
{
    /// <summary>Sets the sample up in the open scene, with the assets of the sample's README wherever they are in the
    /// project.</summary>
    public static class SkirtSceneMenu
    {
        [MenuItem("GameObject/dcloth/Skirt Sample", false, 10)]
        public static void Create()
        {
            var garment = Find<DClothAsset>("skirt");
            var sequence = Find<TextAsset>("walk_turn");
            if (garment == null || sequence == null)
            {
                Debug.LogError("dcloth: the sample needs " + (garment == null ? "skirt.dcloth" : "walk_turn.bytes") +
                               " in the project; its README says where they come from");
                return;
            }
            var holder = new GameObject("dcloth skirt sample");
            holder.AddComponent<SkirtSample>().Configure(garment, sequence, Find<Material>("skirt"));
            Undo.RegisterCreatedObjectUndo(holder, "Create dcloth skirt sample");
            if (Camera.main != null)
            {
                Transform view = Camera.main.transform;
                Undo.RecordObject(view, "Look at dcloth skirt sample");
                view.SetPositionAndRotation(new Vector3(-1.2f, 1.2f, 7), Quaternion.Euler(0, 180, 0));
            }
            Selection.activeGameObject = holder;
        }

        // The asset of exactly that name; the search itself takes parts of names, too.
        private static T Find<T>(string name) where T : Object
        {
            return AssetDatabase.FindAssets(name + " t:" + typeof(T).Name)
                .Select(guid => AssetDatabase.LoadAssetAtPath<T>(AssetDatabase.GUIDToAssetPath(guid)))
                .FirstOrDefault(asset => asset != null && asset.name == name);
        }
    }
}
