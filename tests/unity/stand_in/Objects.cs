// A stand-in for the part of Unity that the package uses: the same names and signatures, enough behaviour to run the
// components without an editor. What is Unity's own business (rendering, serialization, import) is only recorded.
using System;
using System.Collections.Generic;
using System.Linq;
using System.Reflection;

namespace UnityEngine
{
    [Flags]
    public enum HideFlags { None = 0, DontSave = 52 }

    public class Object
    {
        private bool destroyed;

        public string name { get; set; } = "";
        public HideFlags hideFlags { get; set; }

        public static void Destroy(Object what)
        {
            DestroyImmediate(what);
        }

        public static void DestroyImmediate(Object what)
        {
            if (what == null) throw new ArgumentException("destroyed twice");
            what.BeforeDestroy();
            what.destroyed = true;
        }

        public static bool operator ==(Object a, Object b)
        {
            bool noA = ReferenceEquals(a, null) || a.destroyed, noB = ReferenceEquals(b, null) || b.destroyed;
            return noA || noB ? noA && noB : ReferenceEquals(a, b);
        }

        public static bool operator !=(Object a, Object b)
        {
            return !(a == b);
        }

        public override bool Equals(object other)
        {
            return this == other as Object;
        }

        public override int GetHashCode()
        {
            return base.GetHashCode();
        }

        protected virtual void BeforeDestroy()
        {
        }
    }

    public class ScriptableObject : Object
    {
        public static T CreateInstance<T>() where T : ScriptableObject, new()
        {
            return new T();
        }

        protected override void BeforeDestroy()
        {
            Messages.Send(this, "OnDisable");
        }
    }

    public class Component : Object
    {
        public GameObject gameObject { get; internal set; }
        public Transform transform => gameObject.transform;

        public T GetComponent<T>() where T : Component
        {
            return gameObject.GetComponent<T>();
        }

        public T[] GetComponentsInChildren<T>(bool includeInactive) where T : Component
        {
            return transform.WithChildren().Select(t => t.GetComponent<T>()).Where(c => c != null).ToArray();
        }
    }

    public class Behaviour : Component
    {
    }

    public class MonoBehaviour : Behaviour
    {
        private bool on = true, running;
        internal Action Update, LateUpdate;

        public new string name => gameObject.name;

        public bool enabled
        {
            get => on;
            set
            {
                on = value;
                Refresh();
            }
        }

        internal void Refresh()
        {
            bool run = on && gameObject.activeSelf;
            if (run == running) return;
            running = run;
            Messages.Send(this, run ? "OnEnable" : "OnDisable");
        }

        internal void Frame(bool late)
        {
            if (!running) return;
            if (Update == null) // the first frame
            {
                Update = Messages.Bind(this, "Update");
                LateUpdate = Messages.Bind(this, "LateUpdate");
                Messages.Send(this, "Start");
            }
            (late ? LateUpdate : Update)();
        }
    }

    public sealed class GameObject : Object
    {
        public static readonly List<MonoBehaviour> Scripts = new List<MonoBehaviour>();
        private readonly List<Component> components = new List<Component>();

        public GameObject(string name = "")
        {
            this.name = name;
            transform = AddComponent<Transform>();
        }

        public Transform transform { get; }
        public int layer { get; set; }
        public bool activeSelf { get; private set; } = true;
        public SceneManagement.Scene scene { get; internal set; }

        public T AddComponent<T>() where T : Component, new()
        {
            var component = new T { gameObject = this };
            components.Add(component);
            if (component is MonoBehaviour script)
            {
                Scripts.Add(script);
                script.Refresh();
            }
            return component;
        }

        public T GetComponent<T>() where T : Component
        {
            foreach (Component component in components)
            {
                if (component is T found) return found;
            }
            return null;
        }

        public void SetActive(bool active)
        {
            activeSelf = active;
            foreach (Component component in components) (component as MonoBehaviour)?.Refresh();
        }

        public static GameObject CreatePrimitive(PrimitiveType type)
        {
            return new GameObject(type.ToString());
        }

        protected override void BeforeDestroy()
        {
            SetActive(false);
        }
    }

    public enum PrimitiveType { Sphere }

    /// <summary>Unity calls private methods by their names.</summary>
    internal static class Messages
    {
        public static Action Bind(object target, string method)
        {
            MethodInfo found = Find(target, method);
            return found == null ? () => { } : (Action)Delegate.CreateDelegate(typeof(Action), target, found);
        }

        public static void Send(object target, string method)
        {
            Bind(target, method)();
        }

        private static MethodInfo Find(object target, string method)
        {
            return target.GetType().GetMethod(method, BindingFlags.Instance | BindingFlags.NonPublic |
                                                          BindingFlags.Public | BindingFlags.DeclaredOnly);
        }
    }

    /// <summary>What a test turns in place of the player's loop.</summary>
    public static class Loop
    {
        public static void Frame(float seconds)
        {
            Time.deltaTime = seconds;
            for (int i = 0; i < GameObject.Scripts.Count; ++i) GameObject.Scripts[i].Frame(false);
            for (int i = 0; i < GameObject.Scripts.Count; ++i) GameObject.Scripts[i].Frame(true);
        }
    }

    public static class Time
    {
        public static float deltaTime { get; internal set; }
    }

    public static class Debug
    {
        public static readonly List<string> Errors = new List<string>(), Warnings = new List<string>();

        public static void LogError(object message, Object context = null)
        {
            Errors.Add(message.ToString());
        }

        public static void LogWarning(object message, Object context)
        {
            Warnings.Add(message.ToString());
        }
    }

    public sealed class TextAsset : Object
    {
        public byte[] bytes { get; set; }
    }
}

namespace UnityEngine.SceneManagement
{
    public struct Scene
    {
        public int handle;
    }

    public static class SceneManager
    {
        public static void MoveGameObjectToScene(GameObject what, Scene scene)
        {
            what.scene = scene;
        }
    }
}
